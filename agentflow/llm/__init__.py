"""Language models: one asynchronous interface, several implementations composed by wrapping."""
