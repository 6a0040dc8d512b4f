"""Data to learn from: generate, filter and import pairs of prompt and machine."""
