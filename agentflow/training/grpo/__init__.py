"""Reinforcement learning: TRL's GRPO with our advantages, rewards and log."""
