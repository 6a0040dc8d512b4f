"""New packages with a part of one's own."""
