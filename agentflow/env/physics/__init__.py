"""Physics engines behind one interface: what moves, how it is built, stepped, read and split."""
