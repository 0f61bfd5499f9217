"""The assembly's files: names, colours, places and volumes after reading back; equal bytes from equal parts."""

from __future__ import annotations

import itertools
import subprocess
import sys

import cadquery
import pytest

from cad.assembly import build_assembly, exploded_offsets, write_step
from cad.camera import camera_part
from cad.errors import FileError, GeometryError
from cad.led_ring.board import led_ring_part
from cad.params import EndcapParams
from cad.ring_spacer import ring_spacer_part
from cad.solids import copied
from cad.step_file import canonical_step


@pytest.fixture(scope="module")
def parts():
    params = EndcapParams(130.0, 8.0)
    return [camera_part(params), ring_spacer_part(params), led_ring_part(params)]


def test_step_reads_back_with_names_colours_places_and_volumes(parts, tmp_path):
    offsets = {"led_ring": (0.0, 0.0, 40.0)}
    write_step(build_assembly(parts, offsets), tmp_path / "a.step")
    children = {child.name: child for child in cadquery.Assembly.importStep(str(tmp_path / "a.step")).children}
    assert list(children) == [part.name for part in parts]
    for part in parts:
        child = children[part.name]
        assert child.color.toTuple()[:3] == pytest.approx(part.color, abs=0.01)
        shape = child.obj.moved(child.loc)
        assert shape.Volume() == pytest.approx(part.solid.volume, rel=1e-6)
        lift = offsets.get(part.name, (0, 0, 0))[2]
        assert shape.BoundingBox().zmax == pytest.approx(part.solid.bounding_box().max.Z + lift, abs=1e-3)


def test_equal_parts_give_equal_bytes(parts, tmp_path):
    first, second = tmp_path / "0.step", tmp_path / "1.step"
    for path in (first, second):
        write_step(build_assembly(parts), path)
    assert first.read_bytes() == second.read_bytes()


def test_the_file_is_the_one_that_cadquery_writes(parts, tmp_path):
    offsets = {"led_ring": (0.0, 0.0, 40.0)}
    write_step(build_assembly(parts, offsets, "exploded"), tmp_path / "a.step")
    theirs = cadquery.Assembly(name="exploded")
    for part in parts:
        place = cadquery.Location(offsets.get(part.name, (0.0, 0.0, 0.0)))
        shape = cadquery.Shape.cast(copied(part.solid).wrapped)
        theirs.add(shape, name=part.name, color=cadquery.Color(*part.color), loc=place)
    theirs.export(str(tmp_path / "b.step"), exportType="STEP")
    assert (tmp_path / "a.step").read_text() == canonical_step((tmp_path / "b.step").read_text())


def test_writing_loads_no_cadquery_and_prints_nothing(tmp_path):
    code = (
        "import sys; from pathlib import Path; from cad.assembly import *; from cad.ring_spacer import *; "
        "from cad.params import EndcapParams; part = ring_spacer_part(EndcapParams(130.0, 8.0)); "
        "write_step(build_assembly([part]), Path(sys.argv[1])); assert 'cadquery' not in sys.modules"
    )
    heard = subprocess.run([sys.executable, "-c", code, tmp_path / "a.step"], capture_output=True, text=True)
    assert (heard.returncode, heard.stdout, heard.stderr) == (0, "", "")


def test_exporting_leaves_no_triangles_in_the_parts(parts, tmp_path):
    from OCP.BRep import BRep_Tool
    from OCP.BRepTools import BRepTools
    from OCP.TopLoc import TopLoc_Location

    solid = parts[0].solid
    BRepTools.Clean_s(solid.wrapped)
    write_step(build_assembly(parts), tmp_path / "a.step")
    assert all(BRep_Tool.Triangulation_s(face.wrapped, TopLoc_Location()) is None for face in solid.faces())


STEP = """FILE_NAME('{path}','{time}',('Author'),(
    'Open CASCADE'),'OCCT x','build123d','Unknown');
DATA;
#4 = MANIFOLD_SOLID_BREP('a',#1);
#5 = MANIFOLD_SOLID_BREP('b',#1);
#6 = NEXT_ASSEMBLY_USAGE_OCCURRENCE('{count}','a','',#1,#2,$
  );
#7 = PRODUCT('Open CASCADE STEP translator 7.9 {count}');
{styles}ENDSEC;
END-ISO-10303-21;
"""
STYLE = """#{a} = MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',(
    #{b}),#9);
#{b} = STYLED_ITEM('color',(#{c}),#{solid});
#{c} = COLOUR_RGB('',{red},0.,0.);
"""


def test_canonical_step_removes_what_changes_and_nothing_else():
    first = STYLE.format(a=10, b=11, c=12, solid=4, red=0.1) + STYLE.format(a=13, b=14, c=15, solid=5, red=0.2)
    second = STYLE.format(a=10, b=11, c=12, solid=5, red=0.2) + STYLE.format(a=13, b=14, c=15, solid=4, red=0.1)
    one = canonical_step(STEP.format(path="/tmp/a", time="2024-01-01T10:00:00", count=9, styles=first))
    two = canonical_step(STEP.format(path="/x", time="2025-01-01T10:00:00", count=10, styles=second))
    assert one == two
    assert one.startswith("FILE_NAME('endcap','2000-01-01T00:00:00',(''),(''),'OCCT x','endcap-toolkit','');")
    assert "#11 = STYLED_ITEM('color',(#12),#4);\n#12 = COLOUR_RGB('',0.1,0.,0.);" in one
    swapped = second.replace("0.2", "0.3")
    assert canonical_step(STEP.format(path="/x", time="t", count=10, styles=swapped)) != one


def test_exploded_offsets_open_every_gap():
    spans = {"base": (-16.0, 0.0), "ring": (-1.0, 7.0), "shell": (6.0, 103.0)}
    offsets = exploded_offsets(spans, 10.0)
    moved = [(low + offsets[n][2], high + offsets[n][2]) for n, (low, high) in spans.items()]
    assert offsets["base"] == (0.0, 0.0, 0.0)
    assert [b[0] - a[1] for a, b in itertools.pairwise(moved)] == pytest.approx([10.0, 10.0])


def test_bad_input(parts, tmp_path):
    with pytest.raises(GeometryError, match="names must differ"):
        build_assembly([parts[0], parts[0]])
    with pytest.raises(GeometryError, match="nose"):
        build_assembly(parts, {"nose": (0.0, 0.0, 1.0)})
    with pytest.raises(FileError, match="gone"):
        write_step(build_assembly(parts), tmp_path / "gone" / "a.step")
    assert not list(tmp_path.iterdir())
