"""Building by hand: what can be changed in a machine, why not, and how it does."""
