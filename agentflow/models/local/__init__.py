"""Models in folders: what a folder says, and a client that answers in this process."""
