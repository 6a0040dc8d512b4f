"""The models of a configuration: which model answers for each role, and how it is reached."""
