"""Reports: recorded runs as self-contained HTML pages. Films are passed in."""
