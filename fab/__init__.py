"""From solids to files that can be printed: meshes, checks, pictures, exports."""

from cad.extras import explain_missing_libraries

explain_missing_libraries()
