"""Roles: a template pair, a typed input, a parser to a typed output, a retry rule each."""
