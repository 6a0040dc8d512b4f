"""Where blocks are, and what follows from it: boxes, balance, gears, locked joints."""
