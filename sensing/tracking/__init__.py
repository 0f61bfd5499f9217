"""Frames in, tracks of the painted dots and the shear field out; the released pipeline and baselines beside."""
