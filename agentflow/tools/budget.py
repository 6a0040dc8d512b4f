"""What an agent may spend. Concurrent calls cannot spend more."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from agentflow.tools.results import Refused


@dataclass
class Allowance:
    """A number of uses of one kind."""

    noun: str
    """What is used, such as "simulation"."""
    instead: str
    """What still works once all are used."""
    left: int
    total: int

    @classmethod
    def of_simulations(cls, total: int) -> Allowance:
        """An allowance of simulations, of which nothing is used yet."""
        return cls("simulation", "`submit` takes any machine that has been simulated", total, total)

    @classmethod
    def of_pictures(cls, total: int) -> Allowance:
        """An allowance of pictures, of which nothing is used yet."""
        return cls("picture", "`describe` and `query` tell positions", total, total)

    def take(self) -> None:
        """Use one, or refuse."""
        if self.left <= 0:
            raise Refused(
                f"all {self.total} {self.noun}s are used; the other tools still work, and "
                f"{self.instead}"
            )
        self.left -= 1

    def give_back(self) -> None:
        """Return one that was not used after all."""
        self.left += 1

    @contextmanager
    def using(self) -> Iterator[None]:
        """Use one, unless the work fails or is cancelled."""
        self.take()
        try:
            yield
        except BaseException:
            self.give_back()
            raise

    def __str__(self) -> str:
        return f"{self.left} of {self.total} {self.noun}s left"


@dataclass
class Budget:
    """What an agent may spend in one stage."""

    submissions: int
    """Machines that it may submit; the last one ends the stage."""
    rollouts: Allowance | None = None
    """Simulations, shared by the stages of a run; None in a stage without simulation."""
    looks: Allowance | None = None
    """Pictures, shared by the stages of a run; None without vision."""
    stages_left: int = 0
    """Stages that follow, which start from the machines of this one."""
