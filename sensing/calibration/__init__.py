"""Photos of the sensor's dots or of a board in, a camera and where it sits out."""
