"""A function test of machines that stay where they are."""

from __future__ import annotations

from agentflow.training.objectives.measuring import Amount, Finding, Findings, FunctionTest, Motion


class Rests(FunctionTest):
    """The root stays where it is."""

    metres: Amount

    def phrase(self) -> str:
        return f"its Starting Block stays within {self.metres:g} m"

    def measure(self, motion: Motion) -> Findings:
        yield "metres", Finding(motion.distance(0, "any"), self.metres, "m", most=True)
