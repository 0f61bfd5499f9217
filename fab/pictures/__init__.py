"""Off-screen pictures of parts."""
