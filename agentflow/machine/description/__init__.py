"""What models are told about the geometry of a machine."""
