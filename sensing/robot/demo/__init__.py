"""The simulated robot as a source of samples; no other module of the robot imports the simulator."""
