"""Estimates the wrench with its covariance from a shear field, filters it, and detects and locates the contact."""
