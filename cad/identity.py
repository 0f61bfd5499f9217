"""Identity of the endcap to which a file belongs: design, dot pattern, camera, silicone and mesh.

    here = identity(EndcapParams(130, 8), silicone="Smooth-Sil 950")
    record["identity"] = here.record()                                    # into a manifest, weights, a reference
    require_same(path, "weights", recorded(record.get("identity"), design), here, "train on data of this endcap")

Exports, data sets, weights, cameras, references, configurations and recordings contain such a record. A program that
opens one compares it with the endcap in use and refuses it with a message that names the difference. A record without
an aspect was written before that aspect was recorded: the aspect then has the released values, which are frozen below.
Standard library only.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cad import dots
from cad.errors import FileError
from cad.lens import camera_module
from cad.materials import silicone as silicone_named
from cad.params import EndcapParams

WORDS = {
    "dots": "dot pattern",
    "camera": "camera",
    "silicone": "silicone",
    "mesh": "mesh",
}  # aspect -> in messages
MUST_AGREE = ("dots", "camera", "silicone")  # between a model, its data and an endcap; a finer mesh may test a coarser
RELEASED = "released"  # label of an aspect with the released values
DIGITS = 9  # decimals that are compared, because files move between machines
Values = Mapping[str, Any]

# Aspects of files that were written before aspects were recorded. Frozen: they never follow a change of the code.
RELEASED_CAMERA: Values = {
    "focal_per_row": 0.514583333,
    "k": [-0.033, -0.007, 0.0, 0.0],
    "max_half_angle_deg": 95.0,
    "pupil_height_mm": 17.0,
}
RELEASED_SILICONE: Values = {"name": "Smooth-Sil 950", "c10_mpa": 0.34, "poisson": 0.49}
RELEASED_RINGS, RELEASED_STEP_DEG = (1, 6, 10, 12, 16, 18, 20, 20, 18, 16, 12, 10, 6, 1), 180.0 / 13  # all rings
RELEASED_DOT_MM, RELEASED_DENT_MM = 2.0, 0.6  # radius of a dot, depth of its dent
RELEASED_PUPIL_MM = 17.0  # height of the entrance pupil above the mating plane


@dataclass(frozen=True)
class Identity:
    """Identity of the endcap on which a result depends.

    Attributes:
        design: parameters of the endcap.
        aspects: name (:data:`WORDS`) -> its values as plain JSON; None where the result does not depend on it.
    """

    design: EndcapParams
    aspects: Mapping[str, Values | None]

    def record(self) -> dict[str, Any]:
        """The identity as plain JSON, for a file."""
        return {"design": self.design.record, **self.aspects, "digest": self.digest}

    def without(self, *aspects: str) -> Identity:
        """Identity of a result that does not depend on the named aspects."""
        return Identity(self.design, {k: None if k in aspects else v for k, v in self.aspects.items()})

    @property
    def digest(self) -> str:
        """SHA-256 over design and aspects as canonical JSON."""
        content = {"design": self.design.digest, **self.aspects}
        return _sha256(content)


def identity(params: EndcapParams, silicone: str | None = None, mesh: Sequence[int] | None = None) -> Identity:
    """Identity of an endcap as the present code makes it.

    Args:
        params: parameters of the endcap.
        silicone: row of cad/materials.csv; None where the result does not depend on it (a picture at rest).
        mesh: counts of the simulator's mesh (core, rings, layers); None where nothing was simulated.

    Raises:
        ParameterError: the silicone is unknown.
    """
    module = camera_module()
    camera = {
        "focal_per_row": module.focal_per_row,
        "k": list(module.k),
        "max_half_angle_deg": module.max_half_angle_deg,
        "pupil_height_mm": params.camera_height_mm,
    }
    angles = [(dot.ring, dot.polar_deg, dot.azimuth_deg) for dot in dots.dot_pattern(params)]
    return Identity(
        params,
        {
            "dots": _dots(angles, params.dot_radius_mm, params.dent_depth_mm),
            "camera": _rounded(camera),
            "silicone": None if silicone is None else _silicone(silicone),
            "mesh": None if mesh is None else {"core_rings_layers": list(mesh)},
        },
    )


def released(params: EndcapParams) -> Identity:
    """Identity of a file without a record: released pattern, camera and silicone, any mesh."""
    return Identity(
        params,
        {"dots": _released_dots(params), "camera": RELEASED_CAMERA, "silicone": RELEASED_SILICONE, "mesh": None},
    )


def recorded(record: Any, design: EndcapParams) -> Identity:
    """Read the record of an identity (:meth:`Identity.record`).

    Args:
        record: plain JSON; None in a file that was written before identities were recorded.
        design: design that such a file states elsewhere.

    Raises:
        ValueError: the record cannot be read, or its digest does not match its values.
    """
    if record is None:
        return released(design)
    if not isinstance(record, Mapping):
        raise ValueError("its identity is no table")
    try:
        params = EndcapParams(**record["design"]) if "design" in record else design
    except TypeError as error:
        raise ValueError(f"its identity has no design ({error})") from error
    before = released(params).aspects
    aspects = {name: record.get(name, before[name]) for name in WORDS}
    if any(not isinstance(values, Mapping | None) for values in aspects.values()):
        raise ValueError("its identity holds what is no table")
    found = Identity(params, aspects)
    if set(WORDS) <= set(record) and record.get("digest") != found.digest:
        raise ValueError("its identity does not match its digest")
    return found


def differing(found: Identity, wanted: Identity, aspects: Iterable[str] = tuple(WORDS)) -> list[str]:
    """Names of the aspects, "design" included, in which two identities differ.

    An aspect on which one of the two does not depend counts as equal.

    Args:
        found: one identity.
        wanted: the other one.
        aspects: aspects that are compared in addition to the design.
    """
    other = ["design"] if found.design.digest != wanted.design.digest else []
    for name in aspects:
        pair = found.aspects.get(name), wanted.aspects.get(name)
        if None not in pair and _canonical(pair[0]) != _canonical(pair[1]):
            other.append(name)
    return other


def require_same(
    path: str | Path,
    what: str,
    found: Identity | None,
    wanted: Identity | None,
    fix: str,
    aspects: Iterable[str] = tuple(WORDS),
) -> None:
    """Refuse a file that was made for another endcap; the message names the first difference.

    Args:
        path: the file.
        what: content of the file, for the message, for example ``weights``.
        found: identity of the file; None: nothing is compared.
        wanted: identity of the endcap in use; None: nothing is compared.
        fix: remedy, for the message.
        aspects: aspects that are compared in addition to the design.

    Raises:
        FileError: the identities differ.
    """
    other = [] if found is None or wanted is None else differing(found, wanted, aspects)
    if found is not None and wanted is not None and other:
        difference = f"{name_of(found, other[0])}, this endcap has {name_of(wanted, other[0])}"
        values = _difference_text(found, wanted, other[0])
        raise FileError(f"{path}: {what} for {difference}{f' ({values})' if values else ''}: {fix}")


def label_of(found: Identity, aspect: str) -> str:
    """An aspect as a word for configurations: ``released``, eight digits of its digest, or the silicone's name."""
    values = found.aspects.get(aspect) or {}
    if aspect == "silicone":
        return str(values.get("name"))
    same = _canonical(values) == _canonical(released(found.design).aspects[aspect])
    return RELEASED if same else _sha256(values)[:8]


def name_of(found: Identity, aspect: str) -> str:
    """An aspect in words: ``the design D130_T8``, ``the released dot pattern``, ``the dot pattern 3f2a91c0``."""
    if aspect == "design":
        return f"the design {found.design.label}"
    label = label_of(found, aspect)
    return f"the {label} {WORDS[aspect]}" if label == RELEASED else f"the {WORDS[aspect]} {label}"


def _difference_text(found: Identity, wanted: Identity, aspect: str) -> str:
    if aspect == "design":
        return ""
    there, here = found.aspects[aspect] or {}, wanted.aspects[aspect] or {}
    names = [name for name in sorted({*there, *here}) if name != "sha256"]
    other = [name for name in names if _canonical(there.get(name)) != _canonical(here.get(name))]
    return "; ".join(f"{name}={there.get(name)}, here {here.get(name)}" for name in other)[:200] or "other places"


def _dots(angles: Sequence[tuple[int, float, float]], radius_mm: float, dent_mm: float) -> Values:
    """Values of a dot pattern: a digest of the angles, and counts and sizes that a reader can compare.

    Args:
        angles: (ring, polar_deg, azimuth_deg) of each dot.
        radius_mm: radius of a dot, mm.
        dent_mm: depth of its dent, mm.
    """
    rings = [
        sum(1 for ring, _, _ in angles if ring == k) for k in range(max((r for r, _, _ in angles), default=-1) + 1)
    ]
    places = [[round(math.fmod(value, 360.0), 6) + 0.0 for value in angle[1:]] for angle in angles]
    return {
        "rings": "-".join(map(str, rings)),
        "dot_radius_mm": round(radius_mm, DIGITS),
        "dent_depth_mm": round(dent_mm, DIGITS),
        "sha256": _sha256({"places": places}),
    }


def _released_dots(params: EndcapParams) -> Values:
    """Values of the released dot pattern at a design, by a formula that is independent of :mod:`cad.dots`."""
    height = RELEASED_PUPIL_MM - params.centre_height_mm
    rim_deg = math.degrees(math.acos(max(-1.0, min(1.0, height / params.inner_radius_mm))))
    last = math.floor((rim_deg - math.degrees(math.asin(RELEASED_DOT_MM / params.inner_radius_mm))) / RELEASED_STEP_DEG)
    angles = [
        (ring, ring * RELEASED_STEP_DEG, 360.0 * index / RELEASED_RINGS[ring])
        for ring in range(last + 1)
        for index in range(RELEASED_RINGS[ring])
    ]
    return _dots(angles, RELEASED_DOT_MM, RELEASED_DENT_MM)


def _silicone(name: str) -> Values:
    row = silicone_named(name)
    return _rounded({"name": row.name, "c10_mpa": row.neo_hooke_c10_mpa, "poisson": row.poisson})


def _rounded(values: Values) -> Values:
    def one(value: Any) -> Any:
        if isinstance(value, list):
            return [one(part) for part in value]
        return round(value, DIGITS) if isinstance(value, float) else value

    return {name: one(value) for name, value in values.items()}


def _canonical(values: Any) -> str:
    return json.dumps(values, sort_keys=True, separators=(",", ":"), default=dict)


def _sha256(values: Any) -> str:
    return hashlib.sha256(_canonical(values).encode()).hexdigest()
