"""The studio: a local page where people watch runs and build machines by hand."""
