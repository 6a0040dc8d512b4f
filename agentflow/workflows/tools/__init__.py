"""The workflow `tools`: an agent works at a bench, stage by stage."""
