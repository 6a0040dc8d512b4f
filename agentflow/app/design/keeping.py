"""Owns what a run directory keeps beside its lines: where it comes from, and states of machines."""

from __future__ import annotations

import platform
import subprocess
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any

from agentflow import __version__
from agentflow.app.design.conduct import Conducted, Plan, conditions
from agentflow.app.design.models import shown
from agentflow.config.run import DesignConfig
from agentflow.env.archive import save_npz
from agentflow.errors import RunError
from agentflow.files import write_atomically


def keep_rollouts(path: Path, config: DesignConfig, conducted: Conducted) -> None:
    """State trajectories: of every stage's best machine, or of all."""
    rollouts = conducted.laboratory.rollouts
    kept = set(rollouts) if config.keep_rollouts == "all" else _winners(conducted)
    for digest in sorted(kept):
        file = path / "rollouts" / f"{digest}.npz"
        try:
            with write_atomically(file) as part:
                save_npz(rollouts[digest], part)
        except OSError as error:
            raise RunError(f"cannot write {file}: {error.strerror}") from None


def _winners(conducted: Conducted) -> set[str]:
    """Digests of every stage's best machine; the lower trajectory's among equals."""
    found = set()
    for stage in conducted.result.stages:
        scored = [(c.score, -c.trajectory, c.machine) for c in stage.survivors]
        tried = [
            (score, place, made) for score, place, made in scored if score is not None and made
        ]
        if tried:
            found.add(max(tried, key=lambda item: item[:2])[2].digest)
    return found


def run_name(plan: Plan) -> str:
    """When, what for, how and with which seed."""
    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    task = plan.task.name.replace("/", "-")
    return f"{stamp}-{task}-{plan.config.workflow}-seed{plan.config.seed}"


def run_document(plan: Plan) -> dict[str, Any]:
    """What run.yaml says: the resolved configuration, and what else decides the result."""
    return {
        "agentflow": __version__,
        "commit": _commit(),
        **conditions(plan),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "config": shown(plan.config),
    }


@cache
def _commit() -> str | None:
    """The git commit of the code, where it runs from a checkout."""
    try:
        done = subprocess.run(
            ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"],
            capture_output=True,
            text=True,
            check=False,
        )
    except OSError:
        return None
    return done.stdout.strip() or None
