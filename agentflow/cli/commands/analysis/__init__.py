"""Commands that measure models and machines beyond their scores."""
