"""How designers behave: what they predict, how they edit, how they repair."""
