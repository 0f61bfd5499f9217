"""The running estimator of the robot: sources of samples and outputs of estimates."""
