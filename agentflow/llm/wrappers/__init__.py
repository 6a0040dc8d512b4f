"""Clients around a client: retries, limits, budget, tape."""
