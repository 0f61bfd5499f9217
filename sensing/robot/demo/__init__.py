"""The simulated robot as a source of samples; nothing else of the robot knows the simulator."""
