"""Into how many finer steps a step is divided: more while machines settle and as they start."""

from sys import maxsize

from agentflow.env.constants import Constants


class Stepping:
    """Decides how the steps of one world are divided.

    Fine steps have a rate of their own: the higher the rate of the undivided steps, the less is
    left to divide. They last longer after a switch that loads a connection heavily: what a throw
    breaks depends on the step. Changing the length of steps disturbs what rests on contacts, so
    steps that have become coarse stay so until the next switch, whatever the machine does.
    """

    def __init__(self, physics: Constants, rate: float, settle_rate: float) -> None:
        """Start with undivided steps.

        Args:
            physics: The constants.
            rate: Undivided steps per second.
            settle_rate: Least rate with power off, Hz (`engine.World.settle_rate`).
        """
        self._fine = _divide(rate, physics["fine_rate"])
        self.settling = _divide(rate, settle_rate)
        """Divisions of a step with power off."""
        self._short = round(physics["fine_time"] * rate)
        self._long = round(physics["fine_time_loaded"] * rate)
        self._heavy = physics["fine_load"]
        self._since = self._end = 0
        """Steps since the last switch, and how many of them are fine."""
        self.alike = maxsize
        """How many steps, the last one included, are divided alike at least until a switch."""

    def switch(self) -> None:
        """Take fine steps for some time, as something was switched."""
        self._since, self._end = 0, self._short

    def advance(self, load: float) -> int:
        """Divisions of the next step after settling.

        Args:
            load: The greatest load over strength of a connection at the moment.
        """
        if self._since >= self._end:
            self.alike = maxsize
            return 1
        if load >= self._heavy:
            self._end = self._long
        self.alike = self._end - self._since
        self._since += 1
        return self._fine


def _divide(rate: float, fine: float) -> int:
    """The least power of 2 that multiplies a rate to `fine` or more."""
    divisions = 1
    while divisions * rate < fine:
        divisions *= 2
    return divisions
