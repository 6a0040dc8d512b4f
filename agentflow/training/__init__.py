"""Learning: data, fine-tuning, reinforcement learning and their evaluation."""
