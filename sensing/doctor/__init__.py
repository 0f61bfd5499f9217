"""What is wrong with a camera and its picture, and what to do about it: ``python -m sensing.sources check``."""
