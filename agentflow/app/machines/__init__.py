"""Machine files: check, edit, convert."""
