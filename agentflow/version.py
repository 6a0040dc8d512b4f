"""The version of agentflow, which the build reads from here as well. Imports nothing."""

__version__ = "0.1.0"
"""Version of the installed package."""
