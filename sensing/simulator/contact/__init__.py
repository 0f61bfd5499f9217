"""Rigid bodies and their frictional contact with the shell (N, mm, MPa)."""
