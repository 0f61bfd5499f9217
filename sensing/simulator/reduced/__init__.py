"""Reduced models: displacement modes (level 3) and the fitted library (level 4)."""
