"""Fit and bond coupons: files, meshes, checks."""
