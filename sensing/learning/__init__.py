"""Labelled frames in, weights and their errors out; nothing that runs live imports it."""
