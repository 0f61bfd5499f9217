"""Shear field: its operator from dots to a grid, the compiled kernels, and its picture."""
