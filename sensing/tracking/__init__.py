"""Tracks the painted dots and computes the shear field from frames; holds the released pipeline and baselines, too."""
