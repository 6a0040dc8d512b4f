"""What levels are made of: roads, rings, barriers and how they are judged."""
