"""The result of training, as text for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from agentflow.cli.display.text import number


def show_training(result: Mapping[str, Any]) -> None:
    """Print where the trained model is, and how to use it."""
    print(f"{result['label']}: {result['steps']} steps in {number(result['seconds'])} s")
    if result.get("dev_loss") is not None:
        print(f"loss on dev.jsonl: {number(result['dev_loss'])}")
    print(f"model: {result['model']}")
    print(f"design with it: agentflow design --task throwing --model {result['model']}")
