"""Controllers in a rollout: what sensors read, how laws are evaluated, what is told of it."""
