"""A tiny model from scratch, and models in folders: loading, sampling, designing with them."""
