"""Simulating many machines: worker processes, and stores of finished rollouts."""
