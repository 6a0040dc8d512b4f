"""What axes may vary that the built-in model does not read."""

from __future__ import annotations

from agentflow.config.sweep import SweepConfig

UNREAD = frozenset(
    {
        *("prompts", "rationales", "history", "spatial", "vision", "feedback", "querier"),
        *("inspirations", "lessons", "known_lessons", "brief"),
        *("representation", "refinement", "drafts", "simulate_first"),
        *(f"model.sampling.{name}" for name in ("temperature", "top_p", "max_tokens")),
    }
)
"""Keys, without `settings.`, that change what a model reads or how it is sampled: the procedural
model writes the same machines whatever they are."""


def unread_note(sweep: SweepConfig) -> str:
    """A note for a sweep that the procedural model answers; "" if that reads all axes."""
    varied: dict[str, list[object]] = {}
    for axis in sweep.axes.values():
        for key in {key for settings in axis.values() for key in settings}:
            varied[key.removeprefix("settings.")] = [s.get(key) for s in axis.values()]
    unread = sorted(
        key
        for key, values in varied.items()
        if key in UNREAD and any(value != values[0] for value in values)
    )
    if not unread:
        return ""
    return (
        "The procedural model reads its data from prompts but ignores their wording, so what it "
        f"designs does not depend on {' or '.join(unread)}: compare with a language model "
        "(--model)."
    )
