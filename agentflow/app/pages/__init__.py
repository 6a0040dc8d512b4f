"""Pictures, films and pages: of runs, sweeps, galleries and levels."""
