"""Several worlds in one take, side by side: a few as references, many as point instances."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, Vt

from . import figure
from .names import prim_names
from .scene import PROTOTYPE

if TYPE_CHECKING:
    from .take import Take

MOST_REFERENCES = 4
"""Worlds up to this number are prims of their own, which can be edited and simulated again."""
INSTANCER = "/World/Crowd"


def add(
    stage: Usd.Stage, take: Take, edit: dict[str, Usd.EditTarget], skin: bool, joints: str, spacing: float
) -> np.ndarray:
    """All worlds of a take; where their bodies are drawn, (worlds, frames, bodies, 7)."""
    places = np.array(take.worlds, float)
    offsets = layout(len(places), spacing)
    places[..., :3] += offsets[:, None, None]
    if len(places) <= MOST_REFERENCES:
        _references(stage, take, offsets, edit, skin, joints)
    else:
        _instances(stage, take, places, edit)
    return places


def layout(count: int, spacing: float) -> np.ndarray:
    """Where worlds stand (count, 3) [m]: a square about the origin, row by row."""
    side = int(np.ceil(np.sqrt(count)))
    row, column = np.divmod(np.arange(count), side)
    offsets = np.stack([row, column, np.zeros(count)], axis=1) * float(spacing)
    offsets[:, :2] -= 0.5 * (offsets[:, :2].min(axis=0) + offsets[:, :2].max(axis=0))
    return offsets


def _references(
    stage: Usd.Stage,
    take: Take,
    offsets: np.ndarray,
    edit: dict[str, Usd.EditTarget],
    skin: bool,
    joints: str,
) -> None:
    """A class prim holds player, ball and physics once; each world refers to it and moves."""
    paths = figure.add(stage, PROTOTYPE, take.world(0), edit, skin, joints, moving=False)
    for target in edit.values():
        if prim := target.GetLayer().GetPrimAtPath(PROTOTYPE):
            prim.specifier = Sdf.SpecifierClass
    stage.SetEditTarget(edit["scene"])
    for world, offset in enumerate(offsets):
        path = f"/World/World_{world}"
        xform = UsdGeom.Xform.Define(stage, path)
        xform.GetPrim().GetReferences().AddInternalReference(PROTOTYPE)
        Usd.ModelAPI(xform.GetPrim()).SetKind(Kind.Tokens.group)
        xform.AddTranslateOp().Set(Gf.Vec3d(*offset.tolist()))
        moved = [p and p.replace(PROTOTYPE, path) for p in (paths.get(n) for n in take.body_names)]
        figure.animate(edit["animation"].GetLayer(), take.worlds[world], moved)
        if skin and take.model is not None:
            from . import skel

            skel.animate(edit["animation"].GetLayer(), f"{path}/Player", take.model, take.worlds[world])


def _instances(stage: Usd.Stage, take: Take, places: np.ndarray, edit: dict[str, Usd.EditTarget]) -> None:
    """One PointInstancer: a prototype per body, an instance per body and world, without physics."""
    stage.SetEditTarget(edit["scene"])
    instancer = UsdGeom.PointInstancer.Define(stage, INSTANCER)
    UsdGeom.Scope.Define(stage, f"{INSTANCER}/Prototypes")
    shown = [i for i in range(len(take.body_names)) if any(s.body == i for s in take.shapes)]
    names = prim_names(take.body_names)
    for body in shown:
        name = take.body_names[body]
        path = f"{INSTANCER}/Prototypes/{names[name]}"
        UsdGeom.Xform.Define(stage, path)
        own = [s for s in take.shapes if s.body == body]
        figure.add_visuals(stage, path, own, seams=name == take.ball)
        instancer.GetPrototypesRel().AddTarget(path)
    kinds = np.tile(np.arange(len(shown), dtype=np.int32), len(places))
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(kinds))

    stage.SetEditTarget(edit["animation"])
    positions = instancer.CreatePositionsAttr()
    orientations = instancer.CreateOrientationsAttr()
    quats = np.stack([figure.continuous_quaternions(world[..., 3:]) for world in places])
    for frame in range(places.shape[1]):
        at = np.ascontiguousarray(places[:, frame, shown, :3].reshape(-1, 3), np.float32)
        turned = np.ascontiguousarray(quats[:, frame, shown].reshape(-1, 4), np.float16)
        values = Vt.Vec3fArray.FromNumpy(at), Vt.QuathArray.FromNumpy(turned)
        for attribute, value in zip((positions, orientations), values):
            if frame == 0:
                attribute.Set(value)
            attribute.Set(value, frame)
    stage.SetEditTarget(edit["scene"])
    low, high = places[:, :, shown, :3].min(axis=(0, 1, 2)), places[:, :, shown, :3].max(axis=(0, 1, 2))
    extent = [Gf.Vec3f(*(low - 0.3).tolist()), Gf.Vec3f(*(high + 0.3).tolist())]
    instancer.CreateExtentAttr(extent)
