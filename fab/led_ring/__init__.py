"""LED ring board: circuit, budget, copper, files, light."""
