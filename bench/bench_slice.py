"""Slicing: explicit gyroid mesh against the slicer's own infill, cost against error (D=100 T=8).

    python bench/bench_slice.py             about six minutes on one core; needs PrusaSlicer

Writes beside this file: slice.csv (one row a form and its knob: triangles, size of the project, processor seconds of
the slicer and of making the mesh, printed fraction of the zone, open share of its boundary, grams, print time) and
slice.png. Knobs: grid step of the explicit gyroid, with and without outlines moved out for the lines' round sides;
tolerance of the plain zone's mesh; density asked of the slicer.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.interface import build_flange, build_zone
from cad.params import EndcapParams
from fab.meshing.gyroid import interface_mesh
from fab.meshing.mesh import tessellate
from fab.slice.gcode import read_gcode
from fab.slice.growth import growth_mm
from fab.slice.measure import print_figures, zone_figures
from fab.slice.project_3mf import Project, Volume, single, write_prusa
from fab.slice.run import find_slicer, slice_to_gcode
from fab.slice.settings import part_settings, zone_region

HERE = Path(__file__).parent
PARAMS = EndcapParams(100.0, 8.0)
STEPS_MM = (1.6, 1.2, 0.9, 0.6)
TOLERANCES_MM = (0.5, 0.1, 0.01)
DENSITIES = (10.0, 10.8)  # uncorrected: what one would ask, and what one finds by trial on a thicker zone
ZONE_MM = PARAMS.wall_mm - 2 * PARAMS.skin_mm
GROWN = {"explicit": 0.0, "explicit, grown": growth_mm(ZONE_MM, PARAMS.gyroid)}


def main() -> int:
    """Measure, write the table, draw the curves."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    rows = [*explicit_rows(), *native_rows()]
    write_table(HERE / "slice.csv", rows)
    draw(rows)
    return 0


def explicit_rows() -> list[dict[str, object]]:
    """One row a grid step, with and without growth."""
    rows = []
    for step in STEPS_MM:
        start = time.process_time()
        mesh = interface_mesh(PARAMS, step).mesh
        made_s = time.process_time() - start
        for form, grow in GROWN.items():
            settings = replace(part_settings("interface", "TPU 95A"), grow_mm=round(grow, 4))
            project = single("interface", settings, (Volume("interface", mesh),))
            rows.append(measured(project, form, f"step {step:g} mm", made_s))
    return rows


def native_rows() -> list[dict[str, object]]:
    """One row a tolerance at our density, and one a density that is not corrected."""
    settings, rows = part_settings("interface", "TPU 95A"), []
    right = zone_region(ZONE_MM)
    cases = [(tolerance, right, f"tolerance {tolerance:g} mm") for tolerance in TOLERANCES_MM]
    cases += [(0.01, replace(right, density_percent=density), f"asked {density:g} %") for density in DENSITIES]
    cases.append((0.01, replace(right, anchor_mm=None, solid_below_mm2=None), "default anchors"))
    for tolerance, region, knob in cases:
        start = time.process_time()
        flange, zone = (tessellate(solid, tolerance) for solid in (build_flange(PARAMS), build_zone(PARAMS)))
        made_s = time.process_time() - start
        volumes = (Volume("flange", flange), Volume("zone", zone, region))
        rows.append(measured(single("interface", settings, volumes), "infill", knob, made_s))
    return rows


def measured(project: Project, form: str, knob: str, made_s: float) -> dict[str, object]:
    """Slice and read back."""
    print(f"{form}, {knob}", file=sys.stderr)
    with tempfile.TemporaryDirectory() as scratch:
        path, gcode = Path(scratch) / "a.3mf", Path(scratch) / "a.gcode"
        write_prusa(project, path)
        before = _children_s()
        slice_to_gcode(find_slicer(), path, gcode)
        slicer_s = _children_s() - before
        moves = read_gcode(gcode)
        size = path.stat().st_size
    zone, figures = zone_figures(moves, PARAMS), print_figures(moves, project.settings.filament)
    return {
        "form": form,
        "knob": knob,
        "triangles": sum(_faces(volume.mesh) for volume in project.volumes),
        "project_kb": round(size / 1000),
        "mesh_cpu_s": round(made_s, 2),
        "slicer_cpu_s": round(slicer_s, 2),
        "fraction_percent": round(100 * zone.fraction, 3),
        "fraction_error_points": round(100 * zone.fraction - 10, 3),
        "open_percent": round(100 * zone.open_share, 2),
        "floating_starts": figures.floating_starts,
        "grams": round(figures.grams, 2),
        "print_h": round(figures.time_s / 3600, 2),
    }


def draw(rows: list[dict[str, object]]) -> None:
    """Error and openness against the slicer's time."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    for form, mark in (("explicit", "o"), ("explicit, grown", "s"), ("infill", "^")):
        own = [row for row in rows if row["form"] == form]
        for axis, what in zip(axes, ("fraction_error_points", "open_percent"), strict=True):
            axis.plot([r["slicer_cpu_s"] for r in own], [r[what] for r in own], mark, label=form)
        for row in own:
            words, place = _label(form, str(row["knob"]))
            axes[0].annotate(words, (row["slicer_cpu_s"], row["fraction_error_points"]), fontsize=6.5,
                             textcoords="offset points", **place)  # fmt: skip
    axes[0].axhspan(-0.5, 0.5, color="0.9")
    axes[0].set_ylabel("printed fraction less 10 %, points")
    axes[1].axhline(90, color="0.7")
    axes[1].set_ylabel("open part of the zone's boundary, %")
    for axis in axes:
        axis.set_xlabel("processor time of the slicer, s")
        axis.set_xscale("log")
        axis.set_xticks([5, 10, 20, 40], ["5", "10", "20", "40"])
        axis.minorticks_off()
        axis.set_xlim(3, 60)
    axes[0].set_title("explicit: a mesh, by the step of its grid in mm", fontsize=9)
    axes[1].set_title("gray line: the least that is accepted", fontsize=9)
    axes[0].legend(fontsize=8)
    figure.savefig(HERE / "slice.png", dpi=110)


def _label(form: str, knob: str) -> tuple[str, dict[str, object]]:
    """Words beside a point, and where: of the meshes the number alone, for there are eight close together."""
    if knob.startswith("tolerance"):
        return knob, {"xytext": (0, 6), "ha": "center", "rotation": 90}
    if not knob.startswith("step"):
        return knob, {"xytext": (5, -2)}
    words = knob.removeprefix("step ").removesuffix(" mm")
    if words == "1.6" and form == "explicit":  # its neighbour took the slicer as long
        return words, {"xytext": (-5, -1), "ha": "right"}
    return words, {"xytext": (0, 5 if form.endswith("grown") else -10), "ha": "center"}


def _faces(mesh: trimesh.Trimesh) -> int:
    return len(mesh.faces)


def _children_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    sys.exit(in_one_line(main))
