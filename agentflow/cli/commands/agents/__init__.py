"""Commands for agents and people who design with tools."""
