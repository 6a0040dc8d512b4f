"""Measures of how different machines are. They need the extra `diversity`."""
