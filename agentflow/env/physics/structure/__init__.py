"""How the parts of a machine hold together: trees, loops, drives and shared loads of joints."""
