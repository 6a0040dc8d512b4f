"""Roles that models play: each renders a prompt from a typed input and parses the reply."""
