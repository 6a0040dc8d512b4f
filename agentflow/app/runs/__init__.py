"""A run: carried out, resumed, repeated; who answers, and what it keeps."""
