"""The assembly as STEP: all parts with name and colour, in place or exploded (OCCT's XCAF).

Lengths are in mm in the endcap frame. The GLB is made from the meshes (:mod:`fab.exports.glb`).

Notes:
    The file is reproducible byte for byte (:mod:`cad.step_file`); a new version of OCCT may still write other bytes.
    CadQuery's assembly writes the same bytes, but to import it takes 1.7 s, most of it for VTK.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cad.errors import FileError, GeometryError
from cad.part import Part
from cad.step_file import canonical_step
from cad.whole_file import drafted

if TYPE_CHECKING:
    from OCP.TDF import TDF_Label
    from OCP.TDocStd import TDocStd_Document

Offset = tuple[float, float, float]  # displacement x, y, z in mm


def build_assembly(
    parts: Sequence[Part], offsets: Mapping[str, Offset] | None = None, name: str = "endcap"
) -> TDocStd_Document:
    """Build an assembly from parts.

    Args:
        parts: parts in the endcap frame; each one's name and colour go into the files.
        offsets: displacement of a part by its name (mm), for an exploded view; parts not named stay in place.
        name: name of the assembly's root.

    Returns:
        A document of copies: exporting it neither uses nor changes triangles stored in the parts' solids.

    Raises:
        GeometryError: two parts share a name, or an offset names no part.
    """
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFApp import XCAFApp_Application
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    offsets = offsets or {}
    names = [part.name for part in parts]
    unknown = sorted(set(offsets) - set(names))
    if len(set(names)) < len(names) or unknown:
        raise GeometryError(f"assembly of {names}: names must differ, and offsets for {unknown} move nothing")
    document = TDocStd_Document(TCollection_ExtendedString("BinXCAF"))
    XCAFApp_Application.GetApplication_s().InitDocument(document)
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    shapes.SetAutoNaming_s(False)
    root = shapes.NewShape()
    TDataStd_Name.Set_s(root, TCollection_ExtendedString(name))
    for part in parts:
        _add(document, root, part, offsets.get(part.name, (0.0, 0.0, 0.0)))
    shapes.UpdateAssemblies()
    return document


def _add(document: TDocStd_Document, root: TDF_Label, part: Part, offset: Offset) -> None:
    """Add a copy of a part to the assembly, displaced by ``offset`` (mm)."""
    from build123d import Compound
    from OCP.gp import gp_Trsf, gp_Vec
    from OCP.Quantity import Quantity_Color, Quantity_ColorRGBA, Quantity_TypeOfColor
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TopLoc import TopLoc_Location
    from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool

    from cad.solids import copied  # loads the CAD kernel

    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    label, title = shapes.NewShape(), TCollection_ExtendedString(part.name)
    shapes.SetShape(label, Compound([copied(part.solid)]).wrapped)
    TDataStd_Name.Set_s(label, title)
    shade = Quantity_ColorRGBA(Quantity_Color(*part.color, Quantity_TypeOfColor.Quantity_TOC_sRGB), 1.0)
    XCAFDoc_DocumentTool.ColorTool_s(document.Main()).SetColor(label, shade, XCAFDoc_ColorType.XCAFDoc_ColorSurf)
    place = gp_Trsf()
    place.SetTranslationPart(gp_Vec(*offset))
    TDataStd_Name.Set_s(shapes.AddComponent(root, label, TopLoc_Location(place)), title)


def exploded_offsets(spans_mm: Mapping[str, tuple[float, float]], gap_mm: float) -> dict[str, Offset]:
    """Displacements along z that separate the parts in an exploded view.

    Args:
        spans_mm: lowest and highest z of each part by its name, mm, in the order from base to dome. (The solid of the
            TPU interface is its flange: give the span of its mesh.)
        gap_mm: least clear height between one part and the next, mm; parts that are further apart stay in place.

    Returns:
        Part name -> displacement (x, y, z), mm.
    """
    offsets: dict[str, Offset] = {}
    top = -math.inf
    for name, (low, high) in spans_mm.items():
        lift = max(0.0, top + gap_mm - low)
        offsets[name] = (0.0, 0.0, lift)
        top = high + lift
    return offsets


def write_step(assembly: TDocStd_Document, path: Path) -> None:
    """Write an assembly as a STEP file, which appears complete or not at all.

    Raises:
        FileError: the file could not be written.
    """
    from OCP.Interface import Interface_Static
    from OCP.Message import Message, Message_Gravity
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.STEPControl import STEPControl_StepModelType
    from OCP.XSControl import XSControl_WorkSession

    for printer in Message.DefaultMessenger_s().Printers():
        printer.SetTraceLevel(Message_Gravity.Message_Fail)  # the kernel's statistics are of no use to a user
    try:
        with drafted(path) as draft:
            writer = STEPCAFControl_Writer(XSControl_WorkSession(), False)
            for setting, number in (("surfacecurve.mode", 1), ("precision.mode", 0), ("stepcaf.subshapes.name", 1)):
                Interface_Static.SetIVal_s(f"write.{setting}", number)
            for setting in ("xstep.cascade.unit", "write.step.unit"):
                Interface_Static.SetCVal_s(setting, "MM")
            writer.Transfer(assembly, STEPControl_StepModelType.STEPControl_AsIs)
            writer.Write(str(draft))
            text = draft.read_text()
            _require_whole(path, text.rstrip().endswith("END-ISO-10303-21;"))
            draft.write_text(canonical_step(text))
    except OSError as error:
        raise FileError(f"{path}: cannot be written ({error.strerror}): choose a folder with room") from error


def _require_whole(path: Path, whole: bool) -> None:
    """Refuse a truncated file: OCCT's writers do not report a full disk, but a complete file has an end mark."""
    if not whole:
        raise FileError(f"{path.name}: the writer stopped before its end: make room on the disk")
