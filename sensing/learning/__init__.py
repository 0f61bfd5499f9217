"""Trains weights on labelled frames and measures their errors; nothing that runs live imports it."""
