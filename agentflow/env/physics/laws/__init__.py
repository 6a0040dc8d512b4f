"""Forces that engines do not compute themselves: air, rotors, ropes, springs."""
