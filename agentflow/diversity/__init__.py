"""Measures of how different machines are."""
