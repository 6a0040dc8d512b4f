"""For TRL's `GRPOTrainer`: a reward function, and environments in which models call tools.

It needs nothing but agentflow itself.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from functools import partial, reduce
from inspect import Parameter
from io import BytesIO
from operator import or_
from pathlib import Path
from typing import Any, Literal

from PIL import Image

from agentflow.env.physics.engine import AUTO
from agentflow.integrations.session import Benches, BenchSession, signature_of
from agentflow.rewards import Sample, Scorer, read_knobs, shared_scorer
from agentflow.tools import ToolSpec
from agentflow.tools.bench import TOOLS

Completion = str | Sequence[Mapping[str, Any]]
"""Text, or the messages of a conversation."""


def simulation_reward(
    completions: Sequence[Completion],
    task: str | Sequence[str],
    seed: int | Sequence[int | None] | None = None,
    knobs: object = None,
    *,
    engine: str = AUTO,
    workers: int | None = None,
    **_: object,
) -> list[float | None]:
    """Score machines by simulation, a whole batch together in worker processes.

    `task`, `seed` and `knobs` are columns of the data set, or, with `functools.partial`, one value
    for all rows.

    Args:
        completions: Replies of the model.
        task: Levels, such as "throwing/3".
        seed: Random seeds of the tasks' trials; 0 where there is none.
        knobs: Knobs of the levels to change: mappings, or JSON text.
        engine: Physics engine.
        workers: Worker processes; by default one per processor.

    Returns:
        Scores; 0 without a valid machine. None if a simulation timed out or crashed, which says
        nothing about the reply: TRL leaves such completions out of the group's mean and does not
        learn from them.

    Raises:
        UsageError: A task, knob or engine does not exist.
    """
    count = len(completions)
    samples = [
        Sample(name, reply_text(completion), number or 0, read_knobs(changed), engine)
        for completion, name, number, changed in zip(
            completions,
            _column(task, count),
            _column(seed, count),
            _column(knobs, count),
            strict=True,
        )
    ]
    return [reward.value for reward in shared_scorer(workers).rewards(samples)]


def reply_text(completion: Completion) -> str:
    """The text of a completion; of a conversation, that of its last message."""
    if isinstance(completion, str):
        return completion
    content = completion[-1].get("content") if completion else None
    if isinstance(content, str) or not content:
        return content or ""
    return "\n".join(part["text"] for part in content if part.get("type") == "text")


def _column(value: Any, count: int) -> Sequence[Any]:
    """One value per row."""
    return value if isinstance(value, list | tuple) else [value] * count


class BenchTools:
    """An environment of TRL: one design at a bench after each `reset`. `bench_environment` adds
    the tools, because TRL takes every other public method for one."""

    session: BenchSession

    def __init__(self, benches: Benches) -> None:
        """`benches`: how designs begin."""
        self._benches, self._open = benches, ExitStack()

    def reset(self, task: str, seed: int | None = None, knobs: object = None, **_: object) -> str:
        """Begin a design, with columns of the data set; the budget, which ends the prompt.

        Raises:
            UsageError: The task or a knob does not exist.
        """
        self._open.close()
        self.session = self._open.enter_context(closing(self._benches.begin(task, seed, knobs)))
        return f"\n{self.session.bench.budget_text}"

    def _call(self, tool: str, arguments: Mapping[str, Any]) -> str | list[dict[str, Any]]:
        result = self.session.call(tool, arguments)
        if result.image is None:
            return result.text
        picture = Image.open(BytesIO(result.image))
        return [{"type": "image", "image": picture}, {"type": "text", "text": result.text}]


def bench_environment(
    rollouts: int = 24,
    *,
    vision: bool = False,
    engine: str = AUTO,
    workers: int | None = None,
    out: Path | None = None,
    scorer: Callable[[], Scorer] | None = None,
    scored: bool = True,
) -> Callable[[], BenchTools]:
    """What `GRPOTrainer` takes as `environment_factory`: a design per rollout, by calls of tools.

    Rows of the data set name the level as `task`, and may have `seed` and `knobs`. The reward is
    the score of the submitted machine, and 0 without one. It is None, which TRL leaves out, if a
    simulation timed out or crashed.

    Args:
        rollouts: Simulations of a design.
        vision: Whether the tools include pictures, for models that see.
        engine: Physics engine.
        workers: Worker processes; by default one per processor.
        out: Parent folder of the runs; by default they are not kept.
        scorer: Where machines are simulated, in place of the workers.
        scored: Whether environments have a reward of their own.
    """
    shared = scorer or partial(shared_scorer, workers)
    offered = (tool.spec for tool in TOOLS if vision or tool.needs != "pictures")
    methods = {spec.name: _method(spec) for spec in offered}
    own = {"get_reward": _reward} if scored else {}
    kind = type("Bench", (BenchTools,), {**methods, **own})
    return partial(kind, Benches("TRL", rollouts, vision, engine, shared, out))


def _reward(self: BenchTools) -> float | None:
    """The reward of the rollout, which ends with it; None after a time-out or crash."""
    with closing(self.session) as session:
        return session.score()


_TYPES: Mapping[str, Any] = {"string": str, "integer": int, "number": float, "boolean": bool}
_TYPES = {**_TYPES, "array": list[Any], "object": dict[str, Any], "null": None}


def _method(spec: ToolSpec) -> Callable[..., Any]:
    """A method from whose signature and docstring transformers makes the schema of a tool again."""

    def call(self: BenchTools, **arguments: Any) -> str | list[dict[str, Any]]:
        return self._call(spec.name, arguments)

    signature = signature_of(spec, _annotation, Parameter("self", Parameter.POSITIONAL_ONLY))
    about = "".join(
        f"\n    {name}: {schema['description']}"
        for name, schema in spec.parameters["properties"].items()
    )
    call.__name__ = spec.name
    call.__doc__ = f"{spec.description}\n\nArgs:{about}\n" if about else spec.description
    own = signature.parameters.values()
    call.__annotations__ = {item.name: item.annotation for item in own if item.name != "self"}
    call.__signature__ = signature  # type: ignore[attr-defined]
    return call


def _annotation(schema: Mapping[str, Any]) -> Any:
    """The Python type of a JSON schema, as far as tools use these."""
    kinds = schema.get("anyOf", [schema])
    types = (
        Literal[tuple(kind["enum"])] if "enum" in kind else _TYPES[kind["type"]] for kind in kinds
    )
    return reduce(or_, types)
