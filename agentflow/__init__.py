"""Language models design machines; physics decides whether they work."""

__version__ = "0.1.0"
