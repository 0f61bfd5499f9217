"""Measures contact with an endcap: camera frames to shear fields, wrenches and contacts; and simulates the endcap.

Data flow: frame (:mod:`sensing.sources`) -> dot tracks and shear field (:mod:`sensing.tracking`) -> wrench and contact
(:mod:`sensing.wrench`) -> reading of a running endcap (:mod:`sensing.live`). The records between these stages are in
:mod:`sensing.records`, coordinate frames and signs in :mod:`sensing.frames`. Of ``cad``, only the bottom layer is
imported, which needs the standard library alone.
"""

from cad.extras import prepare_command

prepare_command()
