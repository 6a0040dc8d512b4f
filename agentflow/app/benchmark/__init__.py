"""The benchmark: a sweep with a fixed plan, its scorecard, and leaderboards of scorecards."""
