"""Rollouts on many machines: an adapter to Ray, which starts processes on their nodes."""
