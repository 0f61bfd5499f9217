"""Loading paths of data sets."""
