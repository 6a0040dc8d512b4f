"""Descriptions of a machine's geometry, for models."""
