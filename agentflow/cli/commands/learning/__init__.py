"""Commands for learning: data, training, evaluation."""
