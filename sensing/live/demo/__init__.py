"""The simulated robot as six cameras, for runs without hardware."""
