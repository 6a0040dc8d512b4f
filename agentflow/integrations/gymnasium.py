"""Gymnasium environments in which an episode is one design.

Importing this module registers one for each task family, such as `agentflow/throwing-v0`.
"""

import re
import string
from collections.abc import Mapping
from dataclasses import replace
from io import BytesIO
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from agentflow.env.drawing.look import look_at
from agentflow.env.physics.engine import AUTO
from agentflow.env.tasks.registry import FAMILIES, get_task
from agentflow.errors import UnknownNameError
from agentflow.extras import needs_extra
from agentflow.integrations.episode import DesignEpisode
from agentflow.rewards import Sample, Scorer, read_knobs

with needs_extra("gymnasium"):
    import gymnasium

SUBMIT = "submit"
"""The action that ends an episode."""
MOST_STEPS = 32
"""Actions after which `gymnasium.make` truncates an episode by default."""
LONGEST = 100_000
"""Most characters of an action or observation; a machine of 800 blocks has about 45,000."""
CHARACTERS = string.digits + string.ascii_letters + string.punctuation + " \n\t"
RENDER_MODES = ["rgb_array"]
OPTIONS = ("knobs", "start")
SEEDS = 2**31
"""Seeds that are drawn are below this."""
ACTIONS = f"""
# Actions
An action is text: edit commands for the current machine, or a whole machine, which replaces it.
The reward is the gain in score over the machine before. The action `{SUBMIT}` ends the design.
"""


class DesignEnv(gymnasium.Env[str, str]):
    """The design of one machine by edits.

    An action is text: edit commands, a whole machine, or `submit`. The first observation states
    the rules and the task; every observation states the machine and the feedback on its
    simulation. The reward is the gain in score over the machine before, so the rewards of an
    episode add up to the score of its last machine, less that of its first. An action that cannot
    be carried out changes nothing, and the observation says why.

    Infos hold `machine` (the current one, as JSON text), its `score`, and `status`: `ok`,
    `invalid`, `diverged`, or `refused` for an action that cannot be carried out. If a simulation
    times out or crashes, which says nothing about the action, the machine stays as it was, the
    episode is truncated, and the info has `fault`: leave this step out of what is learned.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": RENDER_MODES, "render_fps": 1}

    def __init__(
        self,
        family: str,
        level: int = 1,
        *,
        knobs: Mapping[str, object] | None = None,
        start: str = "",
        engine: str = AUTO,
        render_mode: str | None = None,
    ) -> None:
        """Set up the environment; simulations run in a worker process, started on first use.

        Args:
            family: Task family.
            level: Level of difficulty.
            knobs: Knobs of the level to change.
            start: The machine that episodes start with, as text; by default only what the task
                gives.
            engine: Physics engine.
            render_mode: `rgb_array` for pictures of the machine as built.

        Raises:
            UsageError: The task, a knob, the engine or the render mode does not exist.
        """
        if render_mode not in (None, *RENDER_MODES):
            raise UnknownNameError("render mode", render_mode, RENDER_MODES)
        self.render_mode = render_mode
        self.action_space = gymnasium.spaces.Text(LONGEST, charset=CHARACTERS)
        self.observation_space = gymnasium.spaces.Text(LONGEST, charset=CHARACTERS)
        self._setting = Sample(f"{family}/{level}", start, knobs=read_knobs(knobs), engine=engine)
        get_task(self._setting.task, self._setting.knobs, engine)
        self._scorer: Scorer | None = None
        self._episode: DesignEpisode | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[str, dict[str, Any]]:
        """Start a new design.

        Args:
            seed: Random seed of the task's trials, as for `agentflow.reward`; without one, it is
                drawn from the environment's random generator.
            options: `knobs` and `start` for this episode; knobs are added to the environment's.

        Raises:
            UsageError: An option or a knob does not exist, or the start machine is not valid.
            NoScoreError: The simulation of the start machine timed out or crashed.
        """
        super().reset(seed=seed)
        for name in options or {}:
            if name not in OPTIONS:
                raise UnknownNameError("option", name, OPTIONS)
        chosen = options or {}
        setting = replace(
            self._setting,
            text=chosen.get("start", self._setting.text),
            seed=int(self.np_random.integers(SEEDS)) if seed is None else seed,
            knobs={**(self._setting.knobs or {}), **read_knobs(chosen.get("knobs"))},
        )
        self._scorer = self._scorer or Scorer(workers=1)
        self._episode = DesignEpisode(self._scorer, setting)
        text = f"{self._episode.rules}{ACTIONS}\n{self._episode.state}"
        return _observation(text), self._info()

    def step(self, action: str) -> tuple[str, float, bool, bool, dict[str, Any]]:
        """Change the machine and simulate it, or end the episode."""
        if action.strip() == SUBMIT:
            return "The design is submitted.", 0.0, True, False, self._info()
        outcome = self._current.act(action)
        info = self._info(outcome.status)
        if outcome.fault:
            info["fault"] = outcome.status
        return _observation(outcome.text), outcome.gain, False, outcome.fault, info

    def render(self) -> NDArray[np.uint8] | None:
        """A picture of the machine as built, (480, 640, 3)."""
        if self.render_mode is None:
            gymnasium.logger.warn("pass render_mode='rgb_array' to gymnasium.make for pictures")
            return None
        return np.asarray(Image.open(BytesIO(look_at(self._current.machine, "iso"))))

    def close(self) -> None:
        """End the worker process."""
        if self._scorer is not None:
            self._scorer.close()
        self._scorer = self._episode = None

    @property
    def _current(self) -> DesignEpisode:
        if self._episode is None:
            raise gymnasium.error.ResetNeeded("call reset() before step() or render()")
        return self._episode

    def _info(self, status: str = "") -> dict[str, Any]:
        """About the current machine; with the status of an action, if it is another."""
        episode = self._current
        return {
            "machine": episode.machine.to_text(),
            "score": episode.score,
            "status": status or episode.status,
        }


def _observation(text: str) -> str:
    """The text with only characters of the observation space."""
    return re.sub(r"[^\n\t -~]", "?", text)[:LONGEST]


for _family in FAMILIES:
    gymnasium.register(
        f"agentflow/{_family}-v0",
        f"{__name__}:{DesignEnv.__name__}",
        max_episode_steps=MOST_STEPS,
        kwargs={"family": _family},
    )
