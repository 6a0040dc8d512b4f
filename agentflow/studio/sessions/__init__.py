"""Sessions: what people do while they build is recorded, for studies of how people design."""
