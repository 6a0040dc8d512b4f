"""The words that choose what a figure shows; light, as the command line offers them."""

from typing import Any, Literal, get_args

from agentflow.errors import UnknownNameError

By = Literal["simulations", "calls", "tokens", "seconds"]
"""What a run spends: machines simulated, calls of models, their tokens, seconds of work."""
View = Literal["curve", "scores", "pareto", "ranks", "validity"]
"""What a figure shows; see `agentflow.plot`."""


def require_word(kind: str, word: str, words: Any) -> None:
    """UnknownNameError unless a word is one of a `Literal`; `kind` says what the words name."""
    if word not in get_args(words):
        raise UnknownNameError(kind, word, get_args(words))
