"""Evaluates models: samples their replies, judges them by simulation, computes the numbers."""
