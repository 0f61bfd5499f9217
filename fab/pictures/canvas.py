"""Canvas for off-screen pictures: panels of shaded surfaces, labels and leader lines (plain VTK).

Pixels are those of the finished picture, x to the right, y up, from the lower left corner. The picture is drawn at
``SUPERSAMPLING`` times that size and averaged, which smooths edges.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from vtkmodules.vtkRenderingCore import vtkRenderer

Color = tuple[float, float, float]  # RGB, 0..1
Point = tuple[float, float]  # x, y in px of the picture, or in mm of its plane
Vector = tuple[float, float, float]  # endcap frame
SUPERSAMPLING = 2
BACKGROUND: Color = (1.0, 1.0, 1.0)
INK: Color = (0.13, 0.15, 0.18)  # of labels and edges
CREASE_DEG = 28.0  # edges sharper than this are shaded sharp and drawn
MAX_SMOOTH_FACES = 250_000  # larger meshes have facets below a pixel: flat shading without edges


@dataclass(frozen=True)
class View:
    """Orthographic view; rows of ``axes`` are the picture's right, its up, and the direction toward the viewer."""

    axes: tuple[Vector, Vector, Vector]

    @classmethod
    def looking_from(cls, toward: Vector, up: Vector) -> View:
        """View from the direction ``toward``, with the direction ``up`` pointing up in the picture (endcap frame)."""
        viewer = np.asarray(toward, dtype=float) / np.linalg.norm(toward)
        right = np.cross(up, viewer)
        right /= np.linalg.norm(right)
        rows = [(float(x), float(y), float(z)) for x, y, z in (right, np.cross(viewer, right), viewer)]
        return cls((rows[0], rows[1], rows[2]))

    def project(self, points: np.ndarray) -> np.ndarray:
        """Coordinates (n, 2) in the picture's plane, mm, of points (n, 3) in the endcap frame, mm."""
        return np.asarray(points) @ np.array(self.axes[:2]).T


@dataclass(frozen=True)
class Surface:
    """Triangles with one colour each.

    Attributes:
        vertices: (n, 3) vertices, mm.
        faces: (m, 3) indices of vertices.
        colors: (m, 3) RGB in 0..1, or one RGB.
        smooth: whether shallow edges are shaded smoothly and sharp ones are drawn.
    """

    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray
    smooth: bool = True


@dataclass(frozen=True)
class Frame:
    """Mapping of points to the pixels of a panel.

    Attributes:
        view: the view.
        rect: left, bottom, width and height of the panel, px.
        centre_mm: point of the picture's plane in the middle of the panel, mm.
        px_per_mm: scale.
    """

    view: View
    rect: tuple[int, int, int, int]  # left, bottom, width, height
    centre_mm: Point
    px_per_mm: float

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) of points (n, 3) in the endcap frame, mm."""
        left, bottom, width, height = self.rect
        middle = np.array([left + width / 2, bottom + height / 2])
        return (self.view.project(points) - np.array(self.centre_mm)) * self.px_per_mm + middle


class Canvas:
    """Picture of fixed size in px, to which panels, labels and lines are added before it is read once."""

    def __init__(self, width_px: int, height_px: int) -> None:
        import vtkmodules.vtkRenderingFreeType
        import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  (registers the renderer)
        from vtkmodules.vtkRenderingCore import vtkRenderer

        self.size = (width_px, height_px)
        self._window = _window()
        self._window.SetOffScreenRendering(1)
        self._window.SetMultiSamples(0)
        self._window.SetNumberOfLayers(2)
        self._window.SetSize(width_px * SUPERSAMPLING, height_px * SUPERSAMPLING)
        backdrop = vtkRenderer()
        backdrop.SetBackground(*BACKGROUND)
        self._window.AddRenderer(backdrop)
        self._overlay = vtkRenderer()
        self._overlay.SetLayer(1)
        self._window.AddRenderer(self._overlay)

    def panel(self, frame: Frame, surfaces: Iterable[Surface]) -> None:
        """Draw surfaces, lit by a key, a fill and two back lights, into a rectangle."""
        from vtkmodules.vtkRenderingCore import vtkLightKit, vtkRenderer

        renderer = vtkRenderer()
        renderer.SetBackground(*BACKGROUND)
        left, bottom, width, height = frame.rect
        renderer.SetViewport(
            left / self.size[0], bottom / self.size[1], (left + width) / self.size[0], (bottom + height) / self.size[1]
        )
        self._window.AddRenderer(renderer)
        for surface in surfaces:
            for actor in _actors(surface):
                renderer.AddActor(actor)
        kit = vtkLightKit()
        kit.SetKeyLightIntensity(0.95)
        kit.SetKeyLightAngle(42.0, 28.0)  # elevation, azimuth: from above and the right
        kit.SetKeyLightWarmth(0.5)
        kit.SetFillLightWarmth(0.5)
        kit.SetHeadLightWarmth(0.5)
        kit.SetBackLightWarmth(0.5)
        kit.SetKeyToFillRatio(2.2)
        kit.SetKeyToHeadRatio(3.0)
        kit.AddLightsToRenderer(renderer)
        _aim(renderer, frame)

    def text(self, at: Point, text: str, size_px: int, align: str = "center", color: Color = INK) -> None:
        """Write one line.

        Args:
            at: (x, y) px of the picture, y upward: middle of the line's height, at the end that ``align`` names.
            text: the line.
            size_px: size of the font, px.
            align: ``left``, ``center`` or ``right``.
            color: RGB in 0..1.
        """
        from vtkmodules.vtkRenderingCore import vtkTextActor

        actor = vtkTextActor()
        actor.SetInput(text)
        style = actor.GetTextProperty()
        style.SetFontFamilyToArial()
        style.SetFontSize(size_px * SUPERSAMPLING)
        style.SetColor(*color)
        style.SetVerticalJustificationToCentered()
        {
            "left": style.SetJustificationToLeft,
            "center": style.SetJustificationToCentered,
            "right": style.SetJustificationToRight,
        }[align]()
        actor.SetPosition(at[0] * SUPERSAMPLING, at[1] * SUPERSAMPLING)
        self._overlay.AddViewProp(actor)

    def line(self, points: Iterable[Point], color: Color = (0.45, 0.48, 0.52), width_px: float = 1.2) -> None:
        """Draw a thin line through points, with a dot at the last one.

        Args:
            points: (x, y) of the points, px of the picture, y upward.
            color: RGB in 0..1.
            width_px: width of the line, px.
        """
        from vtkmodules.vtkCommonCore import vtkPoints
        from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
        from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D

        nodes, cells, data = vtkPoints(), vtkCellArray(), vtkPolyData()
        ids = [nodes.InsertNextPoint(x * SUPERSAMPLING, y * SUPERSAMPLING, 0.0) for x, y in points]
        cells.InsertNextCell(len(ids))
        for index in ids:
            cells.InsertCellPoint(index)
        data.SetPoints(nodes)
        data.SetLines(cells)
        mapper, actor = vtkPolyDataMapper2D(), vtkActor2D()
        mapper.SetInputData(data)
        actor.SetMapper(mapper)
        actor.GetProperty().SetColor(*color)
        actor.GetProperty().SetLineWidth(width_px * SUPERSAMPLING)
        self._overlay.AddViewProp(actor)

    def image(self) -> np.ndarray:
        """Render the picture: (height, width, 3) uint8 RGB, first row at the top."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

        self._window.Render()
        grab = vtkWindowToImageFilter()
        grab.SetInput(self._window)
        grab.ReadFrontBufferOff()
        grab.ShouldRerenderOff()
        grab.Update()
        pixels = vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars())[:, :3]
        self._window.Finalize()
        width, height = self.size
        k = SUPERSAMPLING
        fine = pixels.reshape(height * k, width * k, 3).astype(np.uint16)
        total = np.full((height, width, 3), k * k // 2, dtype=np.uint16)  # rounds the mean instead of truncating
        for row in range(k):
            for column in range(k):
                total += fine[row::k, column::k]
        return (total // (k * k)).astype(np.uint8)[::-1]


def _window() -> Any:
    """Off-screen window: EGL where VTK has it, else VTK's own choice (which tries an X server first)."""
    from vtkmodules import vtkRenderingOpenGL2
    from vtkmodules.vtkRenderingCore import vtkRenderWindow

    return getattr(vtkRenderingOpenGL2, "vtkEGLRenderWindow", vtkRenderWindow)()


def write_png(image: np.ndarray, path: Path) -> None:
    """Write an image (h, w, 3) uint8 RGB as PNG, without date or other metadata."""
    from PIL import Image

    Image.fromarray(np.ascontiguousarray(image)).save(path, format="PNG", optimize=False)


def _aim(renderer: vtkRenderer, frame: Frame) -> None:
    """Set the renderer's parallel camera to the frame."""
    right, up, toward = (np.array(axis) for axis in frame.view.axes)
    focus = right * frame.centre_mm[0] + up * frame.centre_mm[1]
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetFocalPoint(*focus)
    camera.SetPosition(*(focus + 1000.0 * toward))
    camera.SetViewUp(*up)
    camera.SetParallelScale(frame.rect[3] / 2 / frame.px_per_mm)
    renderer.ResetCameraClippingRange()


def _actors(surface: Surface) -> list[Any]:
    """VTK actors of the shaded surface and, if it is smooth, of its sharp edges."""
    from vtkmodules.vtkFiltersCore import vtkFeatureEdges, vtkPolyDataNormals
    from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

    data = _poly_data(surface)
    smooth = surface.smooth and len(surface.faces) <= MAX_SMOOTH_FACES
    mapper, actor = vtkPolyDataMapper(), vtkActor()
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(1.0, 1.0)
    actor.SetMapper(mapper)
    shade = actor.GetProperty()
    shade.BackfaceCullingOn()  # faces of a closed mesh that face away are never visible
    shade.SetAmbient(0.12)
    shade.SetDiffuse(0.88)
    shade.SetSpecular(0.10)
    shade.SetSpecularPower(25.0)
    if not smooth:
        mapper.SetInputData(data)
        shade.SetInterpolationToFlat()
        return [actor]
    normals = vtkPolyDataNormals()
    normals.SetInputData(data)
    normals.SetFeatureAngle(CREASE_DEG)
    normals.ConsistencyOff()
    mapper.SetInputConnection(normals.GetOutputPort())
    edges, edge_mapper, edge_actor = vtkFeatureEdges(), vtkPolyDataMapper(), vtkActor()
    edges.SetInputData(data)
    edges.SetFeatureAngle(CREASE_DEG)
    edges.BoundaryEdgesOff()
    edges.NonManifoldEdgesOff()
    edges.ColoringOff()
    edge_mapper.SetInputConnection(edges.GetOutputPort())
    edge_mapper.ScalarVisibilityOff()
    edge_actor.SetMapper(edge_mapper)
    edge_actor.GetProperty().SetColor(*INK)
    edge_actor.GetProperty().SetOpacity(1.0)
    edge_actor.GetProperty().SetLineWidth(0.7 * SUPERSAMPLING)
    edge_actor.GetProperty().LightingOff()
    return [actor, edge_actor]


def _poly_data(surface: Surface) -> Any:
    """VTK's data of a surface, with colours on its cells."""
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    points, cells, data = vtkPoints(), vtkCellArray(), vtkPolyData()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(surface.vertices, dtype=np.float32), deep=True))
    count = len(surface.faces)
    cells.SetData(
        numpy_to_vtkIdTypeArray(np.arange(0, 3 * count + 1, 3, dtype=np.int64), deep=True),
        numpy_to_vtkIdTypeArray(np.ascontiguousarray(surface.faces, dtype=np.int64).reshape(-1), deep=True),
    )
    data.SetPoints(points)
    data.SetPolys(cells)
    colors = np.broadcast_to(np.round(np.asarray(surface.colors) * 255), (count, 3)).astype(np.uint8)
    data.GetCellData().SetScalars(numpy_to_vtk(np.ascontiguousarray(colors), deep=True))
    return data
