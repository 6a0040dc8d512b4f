"""Clients that wrap another client: retries, rate limits, budget, call log."""
