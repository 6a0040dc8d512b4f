"""A run: carried out, resumed, repeated; who answers, what it costs and keeps."""
