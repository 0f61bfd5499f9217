"""Predicts how a design measures before it is printed: weights by similarity, its study, the map of all designs."""
