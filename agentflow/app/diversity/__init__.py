"""How different the machines of runs, sweeps, training runs and folders are."""
