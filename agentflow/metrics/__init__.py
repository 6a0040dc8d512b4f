"""Numbers of runs: pure functions over their records. Reads no run directories."""
