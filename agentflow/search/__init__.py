"""Search over candidates of any kind; the domain is passed in as `expand` and `evaluate`."""
