"""What axes may vary that changes nothing, for any model or for the built-in one."""

from agentflow.config.sweep import SweepConfig, axis_of_key, list_runs
from agentflow.workflows.registry import WORKFLOWS

UNREAD = frozenset(
    {
        *("prompts", "rationales", "history", "spatial", "vision", "feedback", "querier"),
        *("inspirations", "lessons", "known_lessons", "analyst", "brief"),
        *("representation", "refinement", "drafts", "simulate_first"),
        *(f"model.sampling.{name}" for name in ("temperature", "top_p", "max_tokens")),
    }
)
"""Keys, without `settings.`, that change what a model reads or how it is sampled: the procedural
model writes the same machines whatever they are."""


def unused_note(sweep: SweepConfig) -> str:
    """A note on axes that vary what the workflows do not use; "" if there are none."""
    varied = {key.removeprefix("settings.") for key in axis_of_key(sweep)}
    found: dict[str, None] = {}
    for run in list_runs(sweep.model_copy(update={"seeds": sweep.seeds[:1]})):
        workflow, settings = run.config.workflow, run.config.settings
        for key in WORKFLOWS[workflow].unused(settings):
            if key in varied:
                strategy = f"search.strategy={settings.search.strategy}"
                found[f"{key} changes nothing in the workflow {workflow} with {strategy}"] = None
    return f"{'; '.join(found)}." if found else ""


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
