"""Where blocks are, and what follows from it: boxes, balance, gears, joints that cannot move."""
