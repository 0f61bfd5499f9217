"""Loading paths: how a shell is pressed for a data set."""
