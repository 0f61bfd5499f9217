"""Two-part puzzle mold: where its pieces end and are screwed together, core and cup."""
