"""Parts of levels: roads, rings, barriers, and the scoring that belongs to them."""
