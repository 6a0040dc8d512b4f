"""Rewards for training: of one reply here, of many at once in `scoring`."""

from agentflow.rewards.replies import Reward, reward, reward_async

__all__ = ["Reward", "reward", "reward_async"]
