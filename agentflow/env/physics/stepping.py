"""Into how many finer steps a step is divided: more while machines settle and as they start."""

from __future__ import annotations

from agentflow.env.constants import Constants


class Stepping:
    """Decides how the steps of one world are divided.

    Fine steps have a rate of their own: the higher the rate of the undivided steps, the less is
    left to divide. Changing the length of steps disturbs what rests on contacts, so it is changed
    rarely, and never by what the machine does.
    """

    def __init__(self, physics: Constants, rate: float) -> None:
        self._fine = 1
        while self._fine * rate < physics["fine_rate"]:
            self._fine *= 2
        self._hold = round(physics["fine_time"] * rate)
        self._left = 0
        """How many of the next steps are fine."""

    @property
    def settling(self) -> int:
        """Divisions of a step with power off."""
        return self._fine

    def switch(self) -> None:
        """Take fine steps for some time, as something was switched."""
        self._left = self._hold

    def advance(self) -> int:
        """Divisions of the next step after settling."""
        if not self._left:
            return 1
        self._left -= 1
        return self._fine
