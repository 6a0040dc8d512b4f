"""Studies of how people design: recorded sessions, their episodes, and what is measured in them."""
