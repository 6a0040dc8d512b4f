"""The world in which machines are tried: engines, scenes, rollouts, tasks, feedback."""
