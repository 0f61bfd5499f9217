"""Prove that both CAD front ends share one working kernel.

cadquery and build123d each bring a build of OCP under the same name, and the one installed last wins; only the build
with VTK serves both. A union in each shows that neither got the other's.
"""

import sys

try:
    import build123d
    import cadquery

    joined = build123d.Solid.make_box(1, 1, 1) + build123d.Solid.make_sphere(0.5)
    volume = cadquery.Workplane().box(1, 1, 1).union(cadquery.Workplane().sphere(0.7)).val().Volume()
except Exception as error:  # whatever the reason, the answer is the same
    sys.exit(f"the CAD kernel does not work ({error}): remove .venv and run `make setup` again")
if not (joined.is_valid and volume > 1.0):
    sys.exit("the CAD kernel gave a wrong volume: remove .venv and run `make setup` again")
