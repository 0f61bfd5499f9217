"""From camera frames to a contact wrench. Imports only the standard-library bottom layer of ``cad``."""
