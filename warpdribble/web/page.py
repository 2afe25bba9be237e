"""A take as one HTML file that plays it: any browser, no server, nothing to download.

Motion goes in as integers (a position in 65 535 steps of the take's extent, well below a millimetre on a
court; a quaternion in 1/32 767), shapes as the meshes of the USD take; three.js (MIT, `assets/replay`) draws
them. Of the reference, where the take has one, go 25 poses a second, without fingers.
"""

from __future__ import annotations

import base64
import html
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..sims.files import whole
from ..sims.model import Model
from ..sims.signals import runs
from ..skin import meshes
from ..skin.flesh import Vector
from ..takes import crowd, figure, scene
from ..takes.take import Take, TakeError, check_writable

MOST_WORLDS = 64
"""Worlds that are shown at most, the first ones of a take."""


SCRIPTS = ("figures", "camera", "replay")
GHOST_RATE = 25.0
"""[Hz] at which the reference goes in; a browser draws what is between."""
LIGHT = 0.1
"""[kg] Bodies below this (fingers) are no part of the ghost, but for the ball."""


class Blocks:
    """Arrays in one run of bytes, each at a multiple of 4."""

    def __init__(self) -> None:
        self.data = bytearray()

    def add(self, values: np.ndarray, kind: str) -> dict[str, Any]:
        """Where an array stands: {at, count, kind}. kind: "f4", "u2", "i2", "i1", "u1", "u4"."""
        self.data += b"\0" * (-len(self.data) % 4)
        values = np.ascontiguousarray(values, f"<{kind}").ravel()
        place = {"at": len(self.data), "count": len(values), "kind": kind}
        self.data += values.tobytes()
        return place


def write_replay(
    path: str | Path,
    take: Take,
    contacts: dict[str, np.ndarray] | None = None,
    title: str = "",
    *,
    skin: bool = False,
    spacing: float = 3.0,
    start: float = 0.0,
) -> Path:
    """Write a take as .html; the file appears whole or not at all. Raises TakeError.

    contacts: name -> (frames,) bool, a strip each above the scrub bar. skin: the smooth body of `skin.of`.
    start: [s] where it opens.
    """
    path = check_writable(path, (".html",))
    if skin and take.model is None:
        raise TakeError(path, "a skin needs the take's model")
    from ..assets import path as asset

    blocks = Blocks()
    said = _describe(take, contacts or {}, title, skin, spacing, start, blocks)
    parts = {
        "TITLE": html.escape(title or "take"),
        "THREE": asset("replay/three.js").read_text(encoding="utf-8"),
        "TAKE": json.dumps(said).replace("</", "<\\/"),
        "DATA": base64.b64encode(bytes(blocks.data)).decode(),
        "REPLAY": "\n".join(asset(f"replay/{name}.js").read_text(encoding="utf-8") for name in SCRIPTS),
    }
    page = asset("replay/page.html").read_text(encoding="utf-8")
    text = re.sub(r"@([A-Z]+)@", lambda found: parts[found[1]], page)
    try:
        with whole(path) as part:
            part.write_text(text, encoding="utf-8")
    except OSError as error:
        raise TakeError(path, f"cannot be written: {error.strerror or error}") from None
    return path


def _describe(
    take: Take,
    contacts: dict[str, np.ndarray],
    title: str,
    skin: bool,
    spacing: float,
    start: float,
    blocks: Blocks,
) -> dict[str, Any]:
    worlds = np.asarray(take.worlds[:MOST_WORLDS], float)
    count, frames, bodies = worlds.shape[:3]
    places = worlds[..., :3]
    turns = np.stack([figure.continuous_quaternions(w[..., 3:]) for w in worlds])
    offsets = crowd.layout(count, spacing if count > 1 else 0.0)
    player = [i for i, name in enumerate(take.body_names) if name != take.ball]
    reach = 3.5 if count == 1 else float(np.abs(offsets).max()) + 2.5
    return {
        "title": title,
        "fps": float(take.fps),
        "frames": frames,
        "bodies": bodies,
        "worlds": count,
        "root": player[0] if player else 0,
        "reach": reach,
        "start": float(start),
        "offsets": np.round(offsets, 4).tolist(),
        "contacts": {str(k): _spans(v, take.fps) for k, v in contacts.items()},
        "motion": _motion(places, turns, blocks),
        "meshes": _meshes(take, skin, float(np.abs(places[..., :2]).max()) + reach, blocks),
        "skin": _skin(take.model, blocks) if skin and take.model is not None else None,
        "ghost": _ghost(take, blocks) if take.reference is not None and count == 1 else None,
    }


def _motion(places: np.ndarray, turns: np.ndarray, blocks: Blocks) -> dict[str, Any]:
    """places (..., 3) [m] and unit quaternions turns (..., 4)."""
    low, packed, size = _steps(places)
    at = blocks.add(packed, "u2")
    return {"low": low, "size": size, "places": at, "turns": blocks.add(np.round(turns * 32767), "i2")}


def _ghost(take: Take, blocks: Blocks) -> dict[str, Any]:
    """The reference of a take: its bodies and how they move. carriers: for each body of the take the place in
    `bodies` of what it goes along with where it has no motion of its own, as a finger with its hand."""
    reference, every = np.asarray(take.reference, float), max(1, round(take.fps / GHOST_RATE))
    names = take.body_names
    heavy = [take.model is None or take.model.body_mass[b] > LIGHT for b in range(len(names))]
    bodies = [b for b, name in enumerate(names) if heavy[b] or name == take.ball]
    rows = reference[::every, bodies]
    carriers = []
    for body in range(len(names)):
        while take.model is not None and body not in bodies:
            body = int(take.model.body_parent[body])
        carriers.append(bodies.index(body))
    motion = _motion(rows[..., :3], figure.continuous_quaternions(rows[..., 3:]), blocks)
    return motion | {"bodies": bodies, "frames": len(rows), "fps": take.fps / every, "carriers": carriers}


def _spans(on: np.ndarray, fps: float) -> list[list[float]]:
    """Begin and end [s] of each run of frames in which something holds."""
    return [[round(first / fps, 4), round((last + 1) / fps, 4)] for first, last in runs(on)]


def _steps(values: np.ndarray) -> tuple[list[float], np.ndarray, list[float]]:
    """values (..., 3) as low (3,), whole numbers from 0 to 65 535, and size (3,)."""
    low = values.reshape(-1, 3).min(axis=0)
    size = np.maximum(values.reshape(-1, 3).max(axis=0) - low, 1e-9)
    return low.tolist(), np.round((values - low) / size * 65535), size.tolist()


def _mesh(mesh: meshes.Mesh, colour: Vector, blocks: Blocks) -> dict[str, Any]:
    low, packed, size = _steps(mesh.points)
    kind = "u2" if len(mesh.points) < 65536 else "u4"
    return {
        "colour": [float(c) for c in colour[:3]],
        "low": low,
        "size": size,
        "points": blocks.add(packed, "u2"),
        "normals": blocks.add(np.round(mesh.normals * 127), "i1"),
        "faces": blocks.add(mesh.faces, kind),
    }


def _meshes(take: Take, skin: bool, reach: float, blocks: Blocks) -> list[dict[str, Any]]:
    """What is rigid: body (-1 = the world) and mesh."""
    made = []
    for mesh, colour in scene.court(reach):
        made.append({"body": -1} | _mesh(mesh, colour, blocks))
    for body in range(-1, len(take.body_names)):
        ball = body >= 0 and take.body_names[body] == take.ball
        if skin and body >= 0 and not ball:
            continue
        shapes = [s for s in take.shapes if s.body == body and s.kind != "plane"]
        for part, colour in figure.coloured(shapes, seams=ball):
            made.append({"body": body} | _mesh(part, colour, blocks))
    return made


def _skin(model: Model, blocks: Blocks) -> dict[str, Any]:
    """A skinned mesh per region; bones are bodies, by index."""
    from ..skin import skin

    built = skin.of(model)
    inverse = np.tile(np.eye(4), (len(built.bind_q), 1, 1))
    back = Rotation.from_quat(built.bind_q[:, 3:]).inv()
    inverse[:, :3, :3] = back.as_matrix()
    inverse[:, :3, 3] = -back.apply(built.bind_q[:, :3])
    parts = []
    for number, region in enumerate(built.regions):
        chosen = built.region == number
        used = np.unique(built.mesh.faces[chosen])
        part = _mesh(meshes.faces_of(built.mesh, chosen), built.colours[region], blocks)
        part["bones"] = blocks.add(built.bodies[used], "u2")
        part["weights"] = blocks.add(np.round(skin.WEIGHT_STEPS * built.weights[used]), "u1")
        parts.append(part)
    return {"inverse": inverse.transpose(0, 2, 1).reshape(-1, 16).round(6).tolist(), "parts": parts}
