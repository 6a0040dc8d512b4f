"""Search over candidates, whatever they are: the domain comes in as `expand` and `evaluate`."""
