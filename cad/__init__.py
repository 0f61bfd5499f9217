"""Parametric CAD of the endcap: two numbers in, solids out (build123d). Importing this loads no CAD kernel."""
