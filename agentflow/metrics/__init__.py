"""Owns what is counted of runs: pure functions over their records (spec 6.2). Reads no files."""
