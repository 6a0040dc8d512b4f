"""Design runs: start, resume, replay."""
