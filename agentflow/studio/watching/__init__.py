"""Watching runs: their list, their events as they are written, designs that are started here."""
