"""Sweeps: their cost beforehand, their folder, carrying them out, tables over them."""
