"""The command line: typer commands, a few lines each; the work is app.py's."""
