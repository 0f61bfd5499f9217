"""From camera frames to a contact wrench. Imports only the standard-library bottom layer of ``cad``."""

from cad.extras import prepare_command

prepare_command()
