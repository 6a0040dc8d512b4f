"""Talking to an OpenAI-compatible endpoint over HTTP."""
