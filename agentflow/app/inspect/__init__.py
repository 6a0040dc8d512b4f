"""Looking at recorded runs: the list, one run, its machines, failures, rescoring."""
