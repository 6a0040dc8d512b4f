"""Controllers in a rollout: readings of sensors, evaluation of laws, what designers read of it."""
