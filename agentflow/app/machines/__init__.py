"""Machine files: check, edit, convert, simulate."""
