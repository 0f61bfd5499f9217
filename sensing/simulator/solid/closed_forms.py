"""Level 0: closed forms for a pressed dome, and their limits of validity (N, mm, MPa).

All forms hold for the intact sphere at small strain without friction; each states its validity range. The simulator's
tests and report measure their differences from the full model.
"""

from __future__ import annotations

import math

from cad.materials import HyperelasticLaw
from sensing.simulator.solid.geometry import ShellGeometry


def reissner_stiffness_n_mm(young_mpa: float, poisson: float, radius_mm: float, wall_mm: float) -> float:
    """Stiffness of a thin spherical shell under a point load, F / w.

    Args:
        young_mpa, poisson: Young's modulus E, MPa, and Poisson's ratio nu.
        radius_mm: R, radius of the middle surface, mm.
        wall_mm: wall thickness T, mm.

    Notes:
        F / w = 8 D / l^2 = 4 E T^2 / (R sqrt(3 (1 - nu^2))), D = E T^3 / (12 (1 - nu^2)) and
        l^4 = R^2 T^2 / (12 (1 - nu^2))  (Reissner 1946, doi:10.1002/sapm194625180). Valid for T/R under about 1/20,
        w under T/2 and a load more than 3 l from the edge; a thicker wall also dents locally under the load.
    """
    return 4 * young_mpa * wall_mm**2 / (radius_mm * math.sqrt(3 * (1 - poisson**2)))


def point_stiffness_n_mm(geometry: ShellGeometry, law: HyperelasticLaw) -> float:
    """Reissner's stiffness of the dome (:func:`reissner_stiffness_n_mm` at its middle radius)."""
    return reissner_stiffness_n_mm(law.young_mpa, law.poisson, geometry.mid_radius_mm, geometry.wall_mm)


def hertz_force_n(young_mpa: float, poisson: float, radius_mm: float, depth_mm: float) -> float:
    """Force on a solid elastic sphere (or of a rigid sphere on a half-space) at a depth.

    Args:
        young_mpa, poisson: Young's modulus E, MPa, and Poisson's ratio nu of the elastic body.
        radius_mm: radius R of the sphere, mm.
        depth_mm: approach d, mm.

    Notes:
        F = 4/3 E* sqrt(R) d^(3/2), E* = E / (1 - nu^2), contact radius a = sqrt(R d) (Johnson 1985, Contact Mechanics,
        eq. 4.22-4.24). Valid for a < R/10; for a shell only while a is under about T/4, that is the first touch.
    """
    return 4 / 3 * young_mpa / (1 - poisson**2) * math.sqrt(radius_mm) * depth_mm**1.5


def mindlin_stick_radius_mm(contact_radius_mm: float, tangential_n: float, normal_n: float, friction: float) -> float:
    """Radius of the sticking core of a Hertz contact under a tangential force.

    Args:
        contact_radius_mm: contact radius a, mm.
        tangential_n, normal_n: tangential force Q and normal force P, N.
        friction: Coulomb's mu.

    Notes:
        c = a (1 - Q / (mu P))^(1/3) (Cattaneo 1938, Mindlin 1949; Johnson 1985, eq. 7.40). Zero once Q >= mu P.
    """
    return contact_radius_mm * max(0.0, 1 - tangential_n / (friction * normal_n)) ** (1 / 3)


def flattening_force_n(geometry: ShellGeometry, law: HyperelasticLaw, depth_mm: float) -> float:
    """Force of a rigid plane that flattens a thin shell: Reissner's line, F = k d.

    Args:
        geometry, law: the shell and its silicone.
        depth_mm: approach d of the plane, mm.

    Notes:
        A plane flattens the dome first (Updike, Kalnins 1970, doi:10.1115/1.3408580): the ring of contact grows and the
        force stays nearly linear in the depth until the flattened part inverts, at a depth of about 2 T. Beyond it only
        the full model holds.
    """
    return point_stiffness_n_mm(geometry, law) * depth_mm


def inflated_sphere_pressure_mpa(shear_mpa: float, inner_stretch: float, outer_stretch: float) -> float:
    """Pressure in an incompressible neo-Hookean thick sphere.

    Args:
        shear_mpa: shear modulus mu, MPa.
        inner_stretch, outer_stretch: la and lb, hoop stretches of inner and outer surface.

    Notes:
        p = 2 mu [(1/lb + 1/(4 lb^4)) - (1/la + 1/(4 la^4))] (Ogden 1984, Non-linear Elastic
        Deformations, sec. 5.3). Exact.
    """

    def part(stretch: float) -> float:
        return 1 / stretch + 1 / (4 * stretch**4)

    return 2 * shear_mpa * (part(outer_stretch) - part(inner_stretch))


def lame_displacement_mm(
    pressure_mpa: float, young_mpa: float, poisson: float, inner_mm: float, outer_mm: float, radius_mm: float
) -> float:
    """Radial displacement of a thick sphere under small inner pressure.

    Args:
        pressure_mpa: inner pressure p, MPa.
        young_mpa, poisson: Young's modulus E, MPa, and Poisson's ratio nu.
        inner_mm, outer_mm: inner and outer radius a and b, mm.
        radius_mm: radius r at which the displacement is computed, mm.

    Notes:
        u = p a^3 / (E (b^3 - a^3)) [(1 - 2 nu) r + (1 + nu) b^3 / (2 r^2)] (Lame; Timoshenko, Goodier, art. 136). Exact
        for linear elasticity.
    """
    cubes = pressure_mpa * inner_mm**3 / (young_mpa * (outer_mm**3 - inner_mm**3))
    return cubes * ((1 - 2 * poisson) * radius_mm + (1 + poisson) * outer_mm**3 / (2 * radius_mm**2))
