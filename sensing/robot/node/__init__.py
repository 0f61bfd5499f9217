"""The running estimator: where samples come from, and where estimates go."""
