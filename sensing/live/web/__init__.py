"""The web page of a run, which a process of its own serves."""
