"""A simulated take as USD: what moved, as anyone's viewer shows it.

Z up, metres, kilograms, one time code per frame, `/World` as the default prim with the player, the
ball and the court below it. Every moving body is one Xform with translate and orient, as default
value (frame 0) and as time samples; what is seen are meshes with normals, a bound UsdPreviewSurface
and displayColor.
"""

from __future__ import annotations

import contextlib
import os
import re
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdUtils, Vt

from . import meshes, scene

SUFFIXES = (".usda", ".usdc", ".usdz")
SEAM_COLOUR = (0.05, 0.04, 0.04)


class TakeError(ValueError):
    """A take that cannot be written; the message is one line with the file and the reason."""

    def __init__(self, path: str | Path, reason: str):
        super().__init__(f"{path}: {reason}")


@dataclass(frozen=True)
class Take:
    """Bodies and shapes over time, from plain arrays."""

    body_names: list[str]
    shapes: list
    """Objects with name, body (int, -1 = world), kind, size, pos, quat xyzw and rgba, as
    `sims.Model.shapes`."""
    body_q: np.ndarray
    """(frames, bodies, 7) [m, -], position and quaternion xyzw of each body frame in the world."""
    fps: float
    """Frames per second."""
    ball: str = "ball"
    """Name of the body shown as `/World/Ball`; all others belong to `/World/Player`."""
    notes: dict[str, str] = field(default_factory=dict)
    """Where the take comes from; stored as the layer's custom data."""

    def __post_init__(self):
        if np.ndim(self.body_q) != 3 or np.shape(self.body_q)[1:] != (len(self.body_names), 7):
            raise ValueError(
                f"body_q is {np.shape(self.body_q)}, should be (frames, {len(self.body_names)}, 7)"
            )
        if not len(self.body_q):
            raise ValueError("a take needs at least one frame")
        if not np.isfinite(self.body_q).all():
            raise ValueError("body_q holds values that are not finite")


def check_writable(path: str | Path, suffixes: tuple[str, ...] = SUFFIXES) -> Path:
    """The path, once its suffix is known and its folder is there (it is made) and takes files.
    Raises TakeError."""
    path = Path(path)
    if path.suffix not in suffixes:
        raise TakeError(path, f"name the output with one of {', '.join(suffixes)}")
    if path.is_dir():
        raise TakeError(path, "is a folder; give a file name")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise TakeError(path, f"cannot be written: {error.strerror or error}") from None
    return path


@contextlib.contextmanager
def written_whole(path: Path):
    """A temporary name beside `path` to write to: moved to `path` at the end, removed when
    anything fails."""
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".writing-") as folder:
        part = Path(folder) / path.name
        yield part
        os.replace(part, path)


def write_take(path: str | Path, take: Take) -> Path:
    """Write a take as .usda, .usdc or .usdz; the file appears whole or not at all. Raises
    TakeError."""
    path = check_writable(path)
    try:
        with written_whole(path) as part:
            layer = part.with_suffix(".usdc") if path.suffix == ".usdz" else part
            _write_layer(layer, take)
            if path.suffix == ".usdz" and not UsdUtils.CreateNewUsdzPackage(str(layer), str(part)):
                raise TakeError(path, "the usdz package could not be made")
    except OSError as error:
        raise TakeError(path, f"cannot be written: {error.strerror or error}") from None
    return path


def validate(path: str | Path) -> list[str]:
    """What OpenUSD's own validators say against a file: one line each, empty when it is clean."""
    from pxr import UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path)))
    return [f"{e.GetName()}: {e.GetMessage()}" for e in errors]


def _write_layer(path: Path, take: Take) -> None:
    stage = Usd.Stage.CreateNew(str(path))
    try:
        frames = len(take.body_q)
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        stage.SetMetadata("kilogramsPerUnit", 1.0)
        stage.SetTimeCodesPerSecond(take.fps)
        stage.SetFramesPerSecond(take.fps)
        stage.SetStartTimeCode(0)
        stage.SetEndTimeCode(frames - 1)
        stage.GetRootLayer().customLayerData = dict(take.notes)

        world = UsdGeom.Xform.Define(stage, "/World").GetPrim()
        stage.SetDefaultPrim(world)
        Usd.ModelAPI(world).SetKind(Kind.Tokens.assembly)
        moving = [b for i, b in enumerate(take.body_names) if any(s.body == i for s in take.shapes)]
        paths = {b: f"/World/Player/{prim_name(b)}" for b in moving if b != take.ball}
        if paths:
            _component(stage, "/World/Player")
        if take.ball in moving:
            paths[take.ball] = "/World/Ball"
            _component(stage, "/World/Ball")
        for name, prim in paths.items():
            index = take.body_names.index(name)
            UsdGeom.Xform.Define(stage, prim)
            own = [s for s in take.shapes if s.body == index]
            _visuals(stage, prim, prim_name(name), own, seams=name == take.ball)
        _animate(stage, take, paths)

        static = [s for s in take.shapes if s.body < 0 and s.kind != "plane"]
        path_of_bodies = take.body_q[:, :, :3].reshape(-1, 3)
        scene.add_surroundings(stage, path_of_bodies)
        if static:
            _visuals(stage, "/World/Court", "fixed", static, seams=False)
        stage.GetRootLayer().Save()
    finally:
        del stage


def prim_name(name: str) -> str:
    """A body's name as a legal USD prim name."""
    return re.sub(r"^(?=\d)|[^A-Za-z0-9_]", "_", name) or "_"


def _component(stage, path):
    Usd.ModelAPI(UsdGeom.Xform.Define(stage, path).GetPrim()).SetKind(Kind.Tokens.component)


def _animate(stage, take: Take, paths: dict[str, str]) -> None:
    """Translate and orient of every body: default = frame 0, and a sample per frame, written
    below the stage's API."""
    layer = stage.GetRootLayer()
    positions = take.body_q[:, :, :3].astype(float)
    quats = continuous_quaternions(take.body_q[:, :, 3:])
    with Sdf.ChangeBlock():
        for name, path in paths.items():
            body = take.body_names.index(name)
            prim = layer.GetPrimAtPath(path)
            move = Sdf.AttributeSpec(prim, "xformOp:translate", Sdf.ValueTypeNames.Double3)
            turn = Sdf.AttributeSpec(prim, "xformOp:orient", Sdf.ValueTypeNames.Quatf)
            order = Sdf.AttributeSpec(
                prim, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform
            )
            order.default = Vt.TokenArray([move.name, turn.name])
            translations = [Gf.Vec3d(*p) for p in positions[:, body].tolist()]
            orientations = [Gf.Quatf(w, x, y, z) for x, y, z, w in quats[:, body].tolist()]
            move.default, turn.default = translations[0], orientations[0]
            for frame, (t, r) in enumerate(zip(translations, orientations)):
                layer.SetTimeSample(move.path, frame, t)
                layer.SetTimeSample(turn.path, frame, r)


def continuous_quaternions(quaternions: np.ndarray) -> np.ndarray:
    """The same rotations (frames, ..., 4), normalised, with signs so that neighbouring frames
    are near each other."""
    quaternions = quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)
    flips = np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0.0
    signs = np.where(np.cumsum(flips, axis=0) % 2 == 1, -1.0, 1.0)
    quaternions[1:] *= signs[..., None]
    return quaternions


def _visuals(stage, parent: str, name: str, shapes: list, seams: bool) -> None:
    """One mesh per colour of a body's shapes, named `<body>_visual`, `<body>_visual_2`, ...

    Seams are a mesh of their own: Blender gives faces outside a material subset the first subset's
    material.
    """
    colours = list(dict.fromkeys(tuple(np.round(s.rgba, 4).tolist()) for s in shapes))
    drawn = 0
    for colour in colours:
        mesh = meshes.merge(
            [meshes.shape_mesh(s) for s in shapes if tuple(np.round(s.rgba, 4).tolist()) == colour]
        )
        parts = [(mesh, colour)]
        if seams:
            seam = meshes.ball_seams(mesh)
            parts = [
                (meshes.faces_of(mesh, ~seam), colour),
                (meshes.faces_of(mesh, seam), SEAM_COLOUR),
            ]
        for part, part_colour in parts:
            drawn += 1
            path = f"{parent}/{name}_visual" + (f"_{drawn}" if drawn > 1 else "")
            scene.add_mesh(stage, path, part, part_colour[:3])
