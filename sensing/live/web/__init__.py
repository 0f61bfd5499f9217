"""The page of a run, served by a process of its own."""
