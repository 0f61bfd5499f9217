"""The simulated robot as six cameras: what runs where no camera is."""
