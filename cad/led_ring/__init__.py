"""LED ring: its electronic parts, where they sit, and the board as a solid."""
