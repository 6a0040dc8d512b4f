"""OpenEnv: a server of designs at a bench, whose actions are calls of its tools; and its client."""

import base64
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from openenv.core.client_types import StepResult
from openenv.core.env_client import EnvClient
from openenv.core.env_server import Action, Environment, Observation, State, create_app
from pydantic import Field

from agentflow.errors import UsageError
from agentflow.integrations.session import Benches, BenchSession
from agentflow.rewards import shared_scorer

OPTIONS = ("seed", "episode_id", "task", "knobs")


class BenchAction(Action):
    """A call of a tool."""

    tool: str
    """Its name, as the brief lists it."""
    arguments: Mapping[str, Any] = Field(default_factory=dict)
    """By name, as the tool's JSON schema says."""


class BenchObservation(Observation):
    """The answer to a call; the first observation is the brief.

    `reward` is the score of the submitted machine, and None before the submission. It stays None
    after a time-out or crash: leave such an episode out of what is learned.
    """

    text: str
    """What the model reads."""
    data: Mapping[str, Any] = Field(default_factory=dict)
    """The same as data."""
    refused: bool = False
    """Whether the call was refused; the text says what to change."""
    picture: str | None = None
    """PNG in base64, only of `look`."""
    tools: Sequence[Mapping[str, Any]] = ()
    """Name, description and parameters (a JSON schema) of each tool, only of the brief."""


class BenchState(State):
    """A session so far."""

    task: str = ""
    """Level."""
    seed: int = 0
    """Random seed of its trials."""
    budget: str = ""
    """What is left of the budget, in one sentence."""
    submitted: str = ""
    """The submitted machine as JSON text."""


class BenchEnvironment(Environment[BenchAction, BenchObservation, BenchState]):
    """The design of one machine for each `reset`; sessions share only the worker processes."""

    SUPPORTS_CONCURRENT_SESSIONS = True

    def __init__(self, benches: Benches) -> None:
        """`benches`: how designs begin."""
        super().__init__()
        self._benches, self._state = benches, BenchState()
        self._session: BenchSession | None = None

    def reset(
        self,
        seed: int | None = None,
        episode_id: str | None = None,
        task: str = "throwing",
        knobs: Mapping[str, object] | None = None,
        **others: object,
    ) -> BenchObservation:
        """Begin a design at a level, with a random seed of its trials (0 by default) and changed
        knobs.

        Raises:
            UsageError: The task, a knob or an option does not exist.
        """
        for name in others:
            raise UsageError(f"reset has no option {name!r}; it has {', '.join(OPTIONS)}")
        self.close()
        session = self._session = self._benches.begin(task, seed, knobs)
        self._state = BenchState(episode_id=episode_id, task=task, seed=seed or 0)
        return BenchObservation(
            text=session.bench.brief_text, tools=[vars(spec) for spec in session.bench.tools]
        )

    def step(self, action: BenchAction, **_: object) -> BenchObservation:
        """Call a tool. Simulations have a limit of time of their own.

        Raises:
            UsageError: There was no `reset`.
        """
        session = self._session
        if session is None:
            raise UsageError("no design has begun; call reset first")
        before = session.submitted
        result = session.call(action.tool, action.arguments)
        self._state.step_count += 1
        return BenchObservation(
            text=result.text,
            data=result.data,
            refused=result.refused,
            picture=base64.b64encode(result.image).decode() if result.image else None,
            done=bool(session.submitted),
            reward=session.score() if session.submitted and not before else None,
        )

    @property
    def state(self) -> BenchState:
        """The session so far."""
        session = self._session
        told = (
            {"budget": session.bench.budget_text, "submitted": session.submitted} if session else {}
        )
        return BenchState(**{**self._state.model_dump(), **told})

    def close(self) -> None:
        """End the design with what is submitted; the server calls it when a client leaves."""
        if self._session is not None:
            self._session.close()
        self._session = None


class BenchClient(EnvClient[BenchAction, BenchObservation, BenchState]):
    """A client of the server."""

    def _step_payload(self, action: BenchAction) -> dict[str, Any]:
        return dict(action.model_dump())

    def _parse_result(self, payload: dict[str, Any]) -> StepResult[BenchObservation]:
        ends = {"reward": payload.get("reward"), "done": payload.get("done", False)}
        observation = BenchObservation(**{**payload["observation"], **ends})
        return StepResult(observation=observation, **ends)

    def _parse_state(self, payload: dict[str, Any]) -> BenchState:
        return BenchState(**payload)


def make_app(
    sessions: int = 100,
    *,
    rollouts: int = 24,
    vision: bool = False,
    engine: str = "auto",
    workers: int | None = None,
    out: Path | None = None,
) -> Any:
    """The server as an ASGI application, for uvicorn.

    Args:
        sessions: Clients at a time; more are refused.
        rollouts: Simulations of a session.
        vision: Whether the tools include pictures.
        engine: Physics engine.
        workers: Worker processes; by default one per processor.
        out: Parent folder of the runs; by default they are not kept.
    """
    scorer = partial(shared_scorer, workers)
    benches = Benches("OpenEnv", rollouts, vision, engine, scorer, out)
    environment = partial(BenchEnvironment, benches)
    return create_app(environment, BenchAction, BenchObservation, "agentflow", sessions)
