"""One design by edits: a machine that actions change, and what its simulations score."""

from dataclasses import dataclass, replace

from agentflow.agents.context import RoleInput
from agentflow.agents.refiner import verdict_text
from agentflow.env.tasks.registry import get_task
from agentflow.errors import UsageError
from agentflow.machine import Brief, Machine, apply_script, check, describe_text, read_machine
from agentflow.machine.edits.commands import is_machine, script_lines
from agentflow.prompts.render import PromptSet
from agentflow.rewards import Reward, Sample, Scorer, require_score

RULES = ("world", "format", "geometry", "rules", "motion", "edits", "feedback")
"""Parts of the prompts that say how machines are built and changed."""
TASK = ("task", "blocks", "facts")
"""Parts of the prompts that state the task."""
UNCHANGED = "The machine is unchanged."


def rules_of(brief: Brief) -> str:
    """How machines are built and changed, and a task, as designers see it."""
    return PromptSet().render_parts((*RULES, *TASK), RoleInput(brief).context(None))


@dataclass(frozen=True)
class Outcome:
    """What an action led to."""

    text: str
    """Why nothing changed, if so; then the current machine and the feedback on the new one."""
    gain: float = 0.0
    """Gain in score over the machine before."""
    status: str = "refused"
    """As in `Reward`, or `refused` for an action that cannot be carried out."""
    fault: bool = False
    """Whether the simulation timed out or crashed, so that nothing changed."""


class DesignEpisode:
    """The design of one machine; the gains of its actions add up to what its score has gained."""

    def __init__(self, scorer: Scorer, setting: Sample) -> None:
        """Simulate the first machine.

        Args:
            scorer: Where machines are simulated.
            setting: The task, and the first machine as text; "" for only what the task gives.

        Raises:
            UsageError: The task or a knob does not exist, or the machine is not valid.
            NoScoreError: The simulation of the machine timed out or crashed.
        """
        self._scorer, self._setting = scorer, setting
        self._brief = get_task(setting.task, setting.knobs, setting.engine).brief
        self.machine = self._brief.given
        if setting.text:
            found = self._read(setting.text)
            if isinstance(found, str):
                raise UsageError(f"the start machine is not valid: {found}")
            self.machine = found
        reward = self._rate(self.machine)
        self.score = require_score(reward, setting.task)
        self.status = reward.status
        self.state = self._state(reward)

    @property
    def rules(self) -> str:
        """How machines are built and changed, and the task, as designers see it."""
        return rules_of(self._brief)

    def act(self, action: str) -> Outcome:
        """Change the machine by edit commands, or replace it by a whole machine, and simulate it.

        An action that cannot be carried out changes nothing.
        """
        machine = self._read(action)
        if isinstance(machine, str):
            return Outcome(f"{UNCHANGED}\n{machine}\n\n{self.state}")
        reward = self._rate(machine)
        if reward.value is None:
            text = f"{UNCHANGED}\n{reward.rollout.feedback.text}\n\n{self.state}"
            return Outcome(text, status=reward.status, fault=True)
        gain = reward.value - self.score
        self.machine, self.score, self.status = machine, reward.value, reward.status
        self.state = self._state(reward)
        return Outcome(self.state, gain, reward.status)

    def _read(self, action: str) -> Machine | str:
        """The machine that an action leads to, or what is wrong with the action."""
        if is_machine(script_lines(action)):
            report = check(read_machine(action, self._brief.blocks, self._brief.given), self._brief)
        else:
            outcome = apply_script(self.machine, action, self._brief)
            if not outcome.success:
                return verdict_text(outcome.steps)
            report = check(outcome.machine, self._brief)
        if report.machine is None or report.lasting_problems:
            return "\n".join(problem.message for problem in report.lasting_problems)
        return report.machine

    def _rate(self, machine: Machine) -> Reward:
        return self._scorer.rewards([replace(self._setting, text=machine.to_text())])[0]

    def _state(self, reward: Reward) -> str:
        return (
            f"## Current machine\n{self.machine.to_text()}\n"
            f"{describe_text(self.machine, self._brief)}\n\n"
            f"## Simulation feedback\n{reward.rollout.feedback.text}\n"
        )
