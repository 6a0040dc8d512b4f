"""The default prompts and those of the namer."""
