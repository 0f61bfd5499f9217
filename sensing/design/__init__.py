"""What one design will feel before it is printed: its weights by similarity, its study, the map of all designs."""
