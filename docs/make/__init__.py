"""Makes the generated reference and the static site; `scripts/docs` calls it."""
