"""The block library: what each block type is."""
