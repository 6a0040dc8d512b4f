"""Recorded runs looked at: the list, one run, its machines, what went wrong, rescoring."""
