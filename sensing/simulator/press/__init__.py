"""Equilibria of the pressed shell: full Newton (level 1) and stored tangents (level 2)."""
