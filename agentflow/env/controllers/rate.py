"""How often machines sense."""

RATE = 30.0
"""How often sensors are read and laws evaluated, Hz; where steps are longer, in every step."""
