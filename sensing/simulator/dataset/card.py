"""The card of a data set (``croissant.json``, Croissant 1.0): content, origin, and files with digests.

Croissant is JSON-LD on the words of schema.org; search engines for data sets and ``mlcroissant`` read it. Shards are
NumPy archives, which the format has no reader for: their columns are described as variables, not as record sets.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from cad.whole_file import put_file
from sensing.records_labelled import COLUMNS, shard_files
from sensing.set_manifest import read_manifest

NAME = "croissant.json"  # file name of a Croissant description
PAPER = "https://arxiv.org/abs/2607.15633"  # the authors' paper
CITATION = (
    "Tong, W., Mi, J., Yi, X., Fazeli, N., Huang, X.: Scalable Open-Source Visuotactile Sensor for 6-Axis Contact "
    f"Wrench Estimation in Tensegrity Robots. 2026. {PAPER}"
)
LICENSE = "https://opensource.org/license/mit"
KINDS = {".json": "application/json", ".npz": "application/zip"}  # media types by suffix
# JSON-LD context of Croissant 1.0.
CONTEXT: dict[str, Any] = {
    "@language": "en", "@vocab": "https://schema.org/", "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/", "dct": "http://purl.org/dc/terms/",
    "rai": "http://mlcommons.org/croissant/RAI/", "conformsTo": "dct:conformsTo", "citeAs": "cr:citeAs",
    "column": "cr:column", "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"}, "examples": {"@id": "cr:examples", "@type": "@json"},
    **{name: f"cr:{name}" for name in (
        "equivalentProperty", "extract", "field", "fileProperty", "fileObject", "fileSet", "format", "includes",
        "isLiveDataset", "jsonPath", "key", "md5", "parentField", "path", "recordSet", "references", "regex",
        "repeated", "replace", "samplingRate", "separator", "source", "subField", "transform",
    )},
}  # fmt: skip


def write_card(folder: Path) -> None:
    """Write the card of a complete set.

    Raises:
        FileError: no manifest.
        OSError: the folder cannot be read or written.
    """
    manifest = read_manifest(folder)
    request = manifest["request"]
    files = [folder / name for name in ("manifest.json", "camera.json", "dots.npz")]
    files += shard_files(folder)
    card = {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": f"endcap_D{request['diameter_mm']:g}_T{request['wall_mm']:g}_{request['protocol']}_{request['seed']}",
        "description": _description(request),
        "url": PAPER,
        "license": LICENSE,
        "citeAs": CITATION,
        "version": f"{manifest['format']}.0.0",
        "keywords": ["visuotactile sensor", "contact wrench", "simulation"],
        "variableMeasured": [
            {"@type": "sc:PropertyValue", "name": name, "description": text}
            for name, text in manifest.get("columns", COLUMNS).items()
        ],
        "distribution": [_file(folder, path) for path in files if path.exists()],
    }
    put_file(folder / NAME, (json.dumps(card, indent=1) + "\n").encode(), durable=True)


def _description(request: dict[str, Any]) -> str:
    design = f"D = {request['diameter_mm']:g} mm, wall {request['wall_mm']:g} mm, {request['silicone']}"
    pictured = request.get("render") != "off"
    what, seen = ("frames", "pictures (JPEG)") if pictured else ("states", "no pictures, but the inner surface (mm)")
    body = request.get("indenter", "plane")
    pressed = body if body == "plane" else f"{body} (radius {request['radius_mm']:g} mm)"
    return (
        f"Simulated, labelled {what} of a visuotactile endcap ({design}), indenter {pressed}, protocol "
        f"{request['protocol']}, seed {request['seed']}, sensor {request.get('sensor', 0)}: {seen}, wrench on the "
        "endcap (N, N m, at the origin of its frame), contact, displacements of the dots. Shards are NumPy archives, a "
        "row a frame; manifest.json names columns and options."
    )


def _file(folder: Path, path: Path) -> dict[str, str]:
    name = path.relative_to(folder).as_posix()
    with path.open("rb") as stream:
        digest = hashlib.file_digest(stream, "sha256").hexdigest()
    return {
        "@type": "cr:FileObject", "@id": name, "name": name, "contentUrl": name, "encodingFormat": KINDS[path.suffix],
        "contentSize": f"{path.stat().st_size} B", "sha256": digest,
    }  # fmt: skip
