"""From solids to files that can be printed: meshes, checks, pictures, exports."""

from cad.extras import prepare_command

prepare_command()
