"""Adapters to libraries and programs of others; each imports its own library only when used."""
