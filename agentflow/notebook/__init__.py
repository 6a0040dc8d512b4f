"""What Python programs and notebooks work with: tasks and blocks, what is recorded, figures."""
