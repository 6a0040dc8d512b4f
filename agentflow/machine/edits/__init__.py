"""Changing machines: edit scripts, single moves, random machines and edits."""
