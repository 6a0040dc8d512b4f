"""Controllers in a rollout: what sensors read, how laws are evaluated, what designers read of it."""
