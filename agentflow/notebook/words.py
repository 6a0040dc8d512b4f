"""The words that choose what a figure shows; light, as the command line offers them."""

from __future__ import annotations

from typing import Literal

By = Literal["simulations", "calls", "tokens", "seconds"]
"""What a run spends: machines simulated, calls of models, their tokens, seconds of work."""
View = Literal["curve", "scores", "pareto", "ranks", "validity"]
"""What a figure shows; see `agentflow.plot`."""
