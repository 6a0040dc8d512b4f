"""Evaluates models: samples their replies, judges them by simulation, computes the numbers."""

from agentflow.training.evaluation.replies import JudgedReply, judge
from agentflow.training.evaluation.summary import Summary, summarise

__all__ = ["JudgedReply", "Summary", "judge", "summarise"]
