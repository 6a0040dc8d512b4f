"""A distribution outside agentflow that adds one thing of each kind; see tests/test_plugins.py."""
