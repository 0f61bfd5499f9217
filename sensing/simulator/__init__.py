"""A simulator of the endcap: hyperelastic shell, frictional contact, markers, wrench; camera and renderer beside it."""
