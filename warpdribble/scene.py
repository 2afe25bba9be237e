"""What surrounds a take in its USD file: meshes with materials, a court, lights and a camera."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, UsdGeom, UsdLux, UsdShade, Vt

from .meshes import Mesh, merge

COURT_COLOUR = (0.62, 0.45, 0.27)
LINE_COLOUR = (0.93, 0.90, 0.84)
COURT_HALF = (14.0, 7.5)
"""[m] half length and half width of a regulation court."""
LINE_WIDTH = 0.05


def material(stage, colour) -> UsdShade.Material:
    """The preview surface of a colour, made once per stage."""
    name = "colour_" + "_".join(f"{round(255 * c):03d}" for c in colour)
    path = f"/World/Materials/{name}"
    if stage.GetPrimAtPath(path):
        return UsdShade.Material.Get(stage, path)
    UsdGeom.Scope.Define(stage, "/World/Materials")
    surface = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(
        Gf.Vec3f(*map(float, colour))
    )
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(0.6)
    shader.CreateInput("metallic", Sdf.ValueTypeNames.Float).Set(0.0)
    surface.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return surface


def add_mesh(stage, path: str, mesh: Mesh, colour) -> UsdGeom.Mesh:
    """A mesh prim with normals, extent, displayColor and a bound material. colour: 3 numbers in
    0 to 1."""
    prim = UsdGeom.Mesh.Define(stage, path)
    points = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(mesh.points, dtype=np.float32))
    prim.CreatePointsAttr(points)
    prim.CreateNormalsAttr(
        Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(mesh.normals, dtype=np.float32))
    )
    prim.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    faces = np.ascontiguousarray(mesh.faces, dtype=np.int32)
    prim.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, np.int32)))
    prim.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.ravel()))
    prim.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    prim.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    prim.CreateDisplayColorAttr([Gf.Vec3f(*map(float, colour))])
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material(stage, colour))
    return prim


def add_surroundings(stage, path_of_bodies: np.ndarray) -> None:
    """Court, lights, and a camera that sees every position in path_of_bodies (n, 3) [m]."""
    UsdGeom.Xform.Define(stage, "/World/Court")
    reach = float(np.abs(path_of_bodies[:, :2]).max()) + 3.0
    half = np.maximum(COURT_HALF, reach)
    add_mesh(stage, "/World/Court/floor_visual", _sheet(-half, half, -0.004), COURT_COLOUR)
    add_mesh(stage, "/World/Court/lines_visual", _lines(), LINE_COLOUR)

    sun = UsdLux.DistantLight.Define(stage, "/World/Sun")
    sun.CreateIntensityAttr(2.0)
    sun.CreateNormalizeAttr(True)
    sun.CreateAngleAttr(3.0)
    sun.AddRotateXYZOp().Set(Gf.Vec3f(35.0, 25.0, 0.0))
    sky = UsdLux.DomeLight.Define(stage, "/World/Sky")
    sky.CreateIntensityAttr(0.6)
    _add_camera(stage, path_of_bodies)


def _add_camera(stage, path_of_bodies: np.ndarray) -> None:
    low, high = path_of_bodies.min(axis=0), path_of_bodies.max(axis=0)
    centre = 0.5 * (low + high)
    centre[2] = 0.9
    distance = 3.6 + 1.1 * float(np.linalg.norm((high - low)[:2]))
    back = np.array([0.80, -0.55, 0.25])
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    frame = np.eye(4)
    frame[:3, :3] = [right, np.cross(back, right), back]
    frame[3, :3] = centre + distance * back
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.AddTransformOp().Set(Gf.Matrix4d(frame.tolist()))
    camera.CreateFocalLengthAttr(35.0)
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(20.25)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.05, 200.0))
    camera.CreateFocusDistanceAttr(distance)


def _sheet(low, high, height: float) -> Mesh:
    (x0, y0), (x1, y1) = low, high
    points = np.array([[x0, y0, height], [x1, y0, height], [x1, y1, height], [x0, y1, height]])
    return Mesh(points, np.tile([0.0, 0.0, 1.0], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]]))


def _lines() -> Mesh:
    """The border, the half-way line and the centre circle of a court centred on the origin."""
    x, y, w = *COURT_HALF, 0.5 * LINE_WIDTH
    along = [((-x - w, side - w), (x + w, side + w)) for side in (-y, y)]
    across = [((c - w, -y + w), (c + w, y - w)) for c in (-x, 0.0, x)]
    sheets = [_sheet(low, high, -0.002) for low, high in (*along, *across)]
    angle = np.linspace(0.0, 2.0 * np.pi, 97)[:-1]
    ring = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    points = np.concatenate([(1.8 - w) * ring, (1.8 + w) * ring])
    points[:, 2] = -0.001
    i = np.arange(96)
    j = (i + 1) % 96
    faces = np.concatenate(
        [np.stack([i, i + 96, j + 96], axis=1), np.stack([i, j + 96, j], axis=1)]
    )
    circle = Mesh(points, np.tile([0.0, 0.0, 1.0], (192, 1)), faces)
    return merge([*sheets, circle])
