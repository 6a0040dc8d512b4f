"""The workflow `explore`: machines of many kinds rather than one good machine."""
