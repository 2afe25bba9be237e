"""The player and the ball of a take: an Xform per body, what is seen of it, and how it moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from pxr import Kind, Sdf, Usd, UsdGeom, Vt

from ..sims.model import Shape
from ..sims.signals import continuous
from ..skin import meshes
from ..skin.flesh import Vector
from . import scene, usdphysics
from .names import prim_names

if TYPE_CHECKING:
    from .take import Take

SEAM_COLOUR = (0.05, 0.04, 0.04)


def add(
    stage: Usd.Stage,
    base: str,
    take: Take,
    edit: dict[str, Usd.EditTarget],
    skin: bool,
    joints: str,
    moving: bool = True,
) -> dict[str, str]:
    """Player, ball, physics and, where asked for, the skin below `base`; the bodies' paths by name.

    edit: the edit targets "scene", "physics" and "animation". take: of one world.
    """
    paths = body_paths(take, base)
    stage.SetEditTarget(edit["scene"])
    for parent in dict.fromkeys(path.rpartition("/")[0] for path in paths.values()):
        if parent != base:
            UsdGeom.Xform.Define(stage, parent)
            Usd.ModelAPI(stage.GetPrimAtPath(parent)).SetKind(Kind.Tokens.component)
    for name, path in paths.items():
        UsdGeom.Xform.Define(stage, path)
        if name == take.ball:
            Usd.ModelAPI(stage.GetPrimAtPath(path)).SetKind(Kind.Tokens.component)
        elif skin:
            continue
        own = [s for s in take.shapes if s.body == take.body_names.index(name)]
        add_visuals(stage, path, own, seams=name == take.ball)
    if take.model is not None:
        stage.SetEditTarget(edit["physics"])
        usdphysics.add(stage, base, take.model, take.worlds[0, 0], paths, joints)
    if skin and take.model is not None:
        from . import skel

        stage.SetEditTarget(edit["scene"])
        player, animation = f"{base}/Player", edit["animation"] if moving else None
        skel.add(stage, player, take.model, take.worlds[0], animation)
    if moving:
        animate(edit["animation"].GetLayer(), take.worlds[0], [paths.get(n) for n in take.body_names])
    return paths


def add_static(stage: Usd.Stage, take: Take, edit: dict[str, Usd.EditTarget]) -> None:
    """What belongs to the world: seen below `/World/Court`, and to collide with."""
    shapes = [s for s in take.shapes if s.body < 0]
    if seen := [s for s in shapes if s.kind != "plane"]:
        add_visuals(stage, "/World/Court", seen, seams=False, name="fixed")
    if take.model is not None:
        stage.SetEditTarget(edit["physics"])
        usdphysics.add_world(stage, take.model, shapes)


def body_paths(take: Take, base: str) -> dict[str, str]:
    """Prim path by body name. Bodies without a shape are left out where there is no physics to need them."""
    shown = {s.body for s in take.shapes}
    names = [n for i, n in enumerate(take.body_names) if i in shown or take.model is not None]
    legal = prim_names(names)
    return {n: f"{base}/Ball" if n == take.ball else f"{base}/Player/{legal[n]}" for n in names}


def add_visuals(stage: Usd.Stage, parent: str, shapes: list[Shape], seams: bool, name: str = "") -> None:
    """One mesh per colour of a body's shapes, named `<body>_visual`, `<body>_visual_2`, ...

    Blender merges an Xform with its only mesh and keeps the mesh's name. Seams are a mesh of their own:
    Blender gives faces outside a material subset the first subset's material.
    """
    name = name or parent.rpartition("/")[2]
    for number, (part, colour) in enumerate(coloured(shapes, seams), 1):
        scene.add_mesh(stage, f"{parent}/{name}_visual" + (f"_{number}" if number > 1 else ""), part, colour)


def coloured(shapes: list[Shape], seams: bool) -> list[tuple[meshes.Mesh, Vector]]:
    """A body's shapes as one mesh per colour; those that are fully transparent are left out."""
    shapes = [s for s in shapes if s.rgba[3] > 0.0]
    parts: list[tuple[meshes.Mesh, Vector]] = []
    for colour in dict.fromkeys(_colour(s) for s in shapes):
        mesh = meshes.merge([meshes.shape_mesh(s) for s in shapes if _colour(s) == colour])
        if seams and meshes.is_ball(mesh):
            parts += zip(meshes.ball_parts(mesh), (colour, SEAM_COLOUR), strict=True)
        else:
            parts.append((mesh, colour))
    return parts


def _colour(shape: Shape) -> Vector:
    r, g, b = np.round(np.asarray(shape.rgba[:3], float), 4).tolist()
    return r, g, b


def animate(layer: Sdf.Layer, body_q: np.ndarray, paths: list[str | None]) -> None:
    """Translate and orient of every body with a path: default = frame 0, and a sample per frame.

    body_q: (frames, bodies, 7). Written below the stage's API, which is some ten times as fast.
    """
    positions = np.asarray(body_q[:, :, :3], np.float64)
    quats = continuous_quaternions(body_q[:, :, 3:]).astype(np.float32)
    times = [float(frame) for frame in range(len(body_q))]
    with Sdf.ChangeBlock():
        for body, path in enumerate(paths):
            if path is None:
                continue
            prim = Sdf.CreatePrimInLayer(layer, path)
            move = Sdf.AttributeSpec(prim, "xformOp:translate", Sdf.ValueTypeNames.Double3)
            turn = Sdf.AttributeSpec(prim, "xformOp:orient", Sdf.ValueTypeNames.Quatf)
            order = Sdf.AttributeSpec(
                prim, "xformOpOrder", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform
            )
            order.default = Vt.TokenArray([move.name, turn.name])
            values = (
                (move, Vt.Vec3dArray.FromNumpy(np.ascontiguousarray(positions[:, body]))),
                (turn, Vt.QuatfArray.FromNumpy(np.ascontiguousarray(quats[:, body]))),
            )
            for attribute, samples in values:
                attribute.default = samples[0]
                if len(times) > 1:
                    where = attribute.path
                    for time, sample in zip(times, samples):
                        layer.SetTimeSample(where, time, sample)


def continuous_quaternions(quaternions: np.ndarray) -> np.ndarray:
    """The same rotations (frames, ..., 4), normalised, with signs so that neighbouring frames are near each
    other."""
    quaternions = np.asarray(quaternions, float)
    return continuous(quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True))
