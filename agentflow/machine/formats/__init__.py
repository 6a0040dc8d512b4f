"""Reading and writing machines: model replies, coordinates, Besiege files."""
