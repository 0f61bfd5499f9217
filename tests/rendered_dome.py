"""A picture of an untouched dome, without the simulator's mechanics."""

from cad.params import EndcapParams
from sensing.camera.nominal import nominal_mount
from sensing.records import Image
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import RenderSettings


def rendered(params: EndcapParams, level: str) -> Image:
    """Of sensor 31, at a level of the renderer."""
    settings = RenderSettings(seed=31).at_level(level)
    return DomeRenderer(params, nominal_mount(params), settings).render().image_bgr
