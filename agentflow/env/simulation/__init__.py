"""Simulating one machine: settle, run the window, record, score."""
