"""Pictures, films and 3D files of machines, rollouts and levels."""
