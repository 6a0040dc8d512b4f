"""The page on built-in parts, from the registries: one small table for each kind of part."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from agentflow.agents.registry import ROLES
from agentflow.app.pages.registry import PAGES
from agentflow.app.sweeps.registry import VIEWS
from agentflow.metrics.cells import METRICS
from agentflow.prompts.registry import PROMPT_SETS
from agentflow.prompts.render import PromptSet
from agentflow.search.registry import STRATEGIES
from agentflow.tools.bench import TOOLS
from agentflow.training.advantages import ADVANTAGES
from agentflow.training.grpo.judging import REWARDS
from agentflow.training.objectives.functions import FUNCTIONS
from agentflow.workflows.registry import WORKFLOWS
from docs.make.markdown import blocks, code, generated, sentence, table

ABOUT = (
    "Everything that a configuration or a command can name. Other distributions can add to most of "
    "these lists. Task families and levels are on the page [Tasks](tasks.md), block types on the "
    "page [Blocks](blocks.md)."
)


@dataclass(frozen=True)
class Kind:
    """A kind of part."""

    title: str
    use: str
    """Where its names are given, and where to read more."""
    parts: Mapping[str, str]
    """Name -> description."""


def page() -> str:
    """The whole page."""
    return blocks(generated("Built-in parts", ABOUT), *map(_section, _kinds())) + "\n"


def _section(kind: Kind) -> str:
    rows = [(code(name), sentence(about)) for name, about in kind.parts.items()]
    return blocks(f"## {kind.title}", kind.use, table(("name", "description"), rows))


def _kinds() -> Iterable[Kind]:
    yield Kind(
        "Workflows",
        "`--workflow` and the key `workflow`: see [Search](../explanation/search.md).",
        {name: _about(WORKFLOWS[name].stages) for name in WORKFLOWS.ours},
    )
    yield Kind(
        "Search strategies",
        "`search.strategy`: see [Search](../explanation/search.md).",
        {name: _about(STRATEGIES[name]) for name in STRATEGIES.ours},
    )
    yield Kind(
        "Roles",
        "`--role` and `model.roles`: see [Prompts and roles](../explanation/prompts-and-roles.md).",
        {name: _about(ROLES[name]) for name in ROLES.ours},
    )
    yield Kind(
        "Prompt sets",
        "The key `prompts`: see [Prompts and roles](../explanation/prompts-and-roles.md).",
        {name: PromptSet(name).about for name in PROMPT_SETS.ours},
    )
    yield Kind(
        "Metrics",
        "`table.metrics` of a sweep: see [Sweeps](../how-to/sweeps.md).",
        {name: METRICS[name].about for name in METRICS.ours},
    )
    yield Kind(
        "Views",
        "`agentflow table --show`: see [Sweeps](../how-to/sweeps.md).",
        {name: _about(VIEWS[name]) for name in VIEWS.ours},
    )
    yield Kind(
        "Pages",
        "`agentflow report --page`: see [Reports](../how-to/report.md).",
        {name: _about(PAGES[name]) for name in PAGES.ours},
    )
    yield Kind(
        "Tools",
        "For agents: see [Tools](tools.md).",
        {tool.spec.name: tool.spec.description.split("\n\n")[0] for tool in TOOLS},
    )
    yield Kind(
        "Advantages",
        "`advantage.name`: see [Learning](../how-to/learning.md).",
        {name: _about(advantage.of) for name, advantage in ADVANTAGES.items()},
    )
    yield Kind(
        "Rewards",
        "`reward` in reinforcement learning: see [Learning](../how-to/learning.md).",
        {name: _about(reward) for name, reward in REWARDS.items()},
    )
    yield Kind(
        "Function tests",
        "`test` of a design objective: see [Learning](../how-to/learning.md).",
        {name: _about(test) for name, test in FUNCTIONS.items()},
    )


def _about(part: object) -> str:
    """The first paragraph of its docstring."""
    text = inspect.getdoc(part)
    if not text:
        raise ValueError(f"{part!r} has no docstring: write one")
    return text.split("\n\n")[0]
