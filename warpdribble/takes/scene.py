"""What surrounds a take in its USD file: meshes with materials, a court and lights."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from ..skin.flesh import Vector
from ..skin.meshes import Mesh, merge, weld

COURT_COLOUR = (0.62, 0.45, 0.27)
LINE_COLOUR = (0.93, 0.90, 0.84)
COURT_HALF = (14.0, 7.5)
"""[m] half length and half width of a regulation court."""
LINE_WIDTH = 0.05
Point = tuple[float, float] | np.ndarray
PROTOTYPE = "/World/Prototype"
"""What several worlds of a take refer to."""


def set_metadata(layer: Sdf.Layer, frames: int, fps: float) -> None:
    """Axis, units and times. Layers of one stage must agree: OpenUSD scales the times of those that do
    not."""
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetMetadata("kilogramsPerUnit", 1.0)
    stage.SetTimeCodesPerSecond(fps)
    stage.SetFramesPerSecond(fps)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(frames - 1)
    layer.defaultPrim = "World"


def define_world(stage: Usd.Stage) -> None:
    world = UsdGeom.Xform.Define(stage, "/World").GetPrim()
    Usd.ModelAPI(world).SetKind(Kind.Tokens.assembly)


def home(path: str) -> str:
    """Below which prim of a stage materials stand for what is at `path`: a reference brings along only what
    is below its target."""
    return PROTOTYPE if path.startswith(PROTOTYPE + "/") else "/World"


def material(stage: Usd.Stage, colour: Vector, where: str) -> UsdShade.Material:
    """The preview surface of a colour, made once below `where`."""
    name = "colour_" + "_".join(f"{round(255 * c):03d}" for c in colour[:3])
    path = f"{where}/Materials/{name}"
    if stage.GetPrimAtPath(path):
        return UsdShade.Material.Get(stage, path)
    UsdGeom.Scope.Define(stage, f"{where}/Materials")
    surface = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*map(float, colour[:3])))
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.6)
    shader.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    surface.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return surface


def add_mesh(stage: Usd.Stage, path: str, mesh: Mesh, colour: Vector | None) -> UsdGeom.Mesh:
    """A mesh prim with normals, extent, displayColor and a bound material. colour: numbers in 0 to 1; None
    leaves both to the caller. Points in one place become one; where their normals differ, corners keep
    them."""
    prim = UsdGeom.Mesh.Define(stage, path)
    welded, faces = weld(mesh)
    sharp = len(welded) < len(mesh.points)
    normals = mesh.normals[mesh.faces.ravel()] if sharp else mesh.normals
    points = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(welded, dtype=np.float32))
    prim.CreatePointsAttr(points)
    prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(normals, dtype=np.float32)))
    prim.SetNormalsInterpolation(UsdGeom.Tokens.faceVarying if sharp else UsdGeom.Tokens.vertex)
    faces = np.ascontiguousarray(faces, dtype=np.int32)
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, np.int32)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.ravel()))
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    if colour is not None:
        prim.CreateDisplayColorAttr([Gf.Vec3f(*map(float, colour[:3]))])
        UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material(stage, colour, home(path)))
    return prim


def add_surroundings(stage: Usd.Stage, path_of_bodies: np.ndarray) -> None:
    """Lights, and a court below every position in path_of_bodies (n, 3) [m]."""
    UsdGeom.Xform.Define(stage, "/World/Court")
    for name, (mesh, colour) in zip(
        ("floor", "lines"), court(float(np.abs(path_of_bodies[:, :2]).max()) + 3.0)
    ):
        add_mesh(stage, f"/World/Court/{name}_visual", mesh, colour)

    sun = UsdLux.DistantLight.Define(stage, "/World/Sun")
    sun.CreateIntensityAttr(2.0)
    sun.CreateNormalizeAttr(True)
    sun.CreateAngleAttr(3.0)
    sun.AddRotateXYZOp().Set(Gf.Vec3f(35.0, 25.0, 0.0))
    sky = UsdLux.DomeLight.Define(stage, "/World/Sky")
    sky.CreateIntensityAttr(0.6)


def court(reach: float) -> list[tuple[Mesh, Vector]]:
    """Floor and lines with their colours; the floor goes on to `reach` [m] from the origin, or further."""
    half = np.maximum(COURT_HALF, reach)
    return [(_slab(-half, half, -0.06, -0.004), COURT_COLOUR), (_lines(), LINE_COLOUR)]


def _slab(low: Point, high: Point, bottom: float, top: float) -> Mesh:
    """A box with flat faces between two points over the ground (2,) [m] and two heights: an importer that
    wants volume finds one."""
    corners = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij")).reshape(3, -1).T
    ends = np.array([[*low, bottom], [*high, top]], float)
    points: list[np.ndarray] = []
    normals: list[np.ndarray] = []
    faces: list[list[int]] = []
    for axis in range(3):
        for side in (0, 1):
            four = ends[corners[corners[:, axis] == side], np.arange(3)]
            ring = [0, 1, 3, 2] if (axis == 1) == (side == 1) else [0, 2, 3, 1]
            faces += [[len(points) + ring[k] for k in t] for t in ((0, 1, 2), (0, 2, 3))]
            points += list(four)
            normals += [np.eye(3)[axis] * (2 * side - 1)] * 4
    return Mesh(np.array(points), np.array(normals), np.array(faces))


def _lines() -> Mesh:
    """The border, the half-way line and the centre circle of a court centred on the origin."""
    x, y, w = *COURT_HALF, 0.5 * LINE_WIDTH
    along = [((-x - w, side - w), (x + w, side + w)) for side in (-y, y)]
    across = [((c - w, -y + w + 1e-4), (c + w, y - w - 1e-4)) for c in (-x, 0.0, x)]
    return merge([*(_slab(low, high, -0.004, -0.002) for low, high in (*along, *across)), _circle(1.8, w)])


def _circle(radius: float, half_width: float, count: int = 96) -> Mesh:
    """A ring on the floor, of quads around a square cross-section."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    out = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    inner, outer = (radius - half_width) * out, (radius + half_width) * out
    up = np.array([0.0, 0.0, 1.0])
    low, high = -0.004 * up, -0.001 * up
    strips = (
        (inner + high, outer + high, np.tile(up, (count, 1))),
        (outer + high, outer + low, out),
        (outer + low, inner + low, np.tile(-up, (count, 1))),
        (inner + low, inner + high, -out),
    )
    i = np.arange(count)
    j = (i + 1) % count
    faces = np.concatenate([np.stack([i, i + count, j + count], 1), np.stack([i, j + count, j], 1)])
    return merge([Mesh(np.concatenate([a, b]), np.concatenate([n, n]), faces) for a, b, n in strips])
