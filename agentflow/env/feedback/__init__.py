"""Feedback to designers: what families share. `compose` puts it together; text and data agree."""
