"""Runs that somebody else designs: an agent over MCP, or with commands."""
