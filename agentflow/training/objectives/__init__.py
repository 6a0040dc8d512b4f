"""Design objectives for training data, and the function tests that see whether machines work."""
