"""Simulates machines of files and runs: once, verified, perturbed, again, on all engines."""
