"""The role that works with tools, and its conversation."""
