"""A distribution outside agentflow that adds one object of each kind; see tests/test_plugins.py."""
