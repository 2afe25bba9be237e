"""Pictures and short films of a take, made here: no viewer, no graphics card.

Rays are cast by a kernel (`kernels.film`), on the device that is asked for. A film is an animated WebP or GIF
that any browser and any page shows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from PIL import Image
from scipy.spatial.transform import Rotation

from ..kernels import film as kernel
from ..sims.files import whole
from ..skin import skin as skins
from ..skin.flesh import Vector
from ..skin.meshes import Mesh, normals
from . import camera, figure
from .take import Take, TakeError, check_writable

SUFFIXES = (".webp", ".gif")
FILLS = 0.72
"""Share of a picture's height that the player takes up."""
RATE = 20.0
"""[Hz]"""
QUALITY = 80
SUN, DISC = np.array([0.45, -0.50, 0.74]), 0.05
SUNLIGHT, SKY, BOUNCE = (0.74, 0.70, 0.63), (0.38, 0.41, 0.45), (0.16, 0.14, 0.12)
FLOOR, LINES, BEYOND, FOG = (0.62, 0.46, 0.30), (0.80, 0.72, 0.60), (0.72, 0.76, 0.80), 10.0


@dataclass(frozen=True)
class Part:
    """Triangles of one colour, or of one a face, and what moves them."""

    faces: np.ndarray
    colours: np.ndarray
    """(faces, 3)"""
    posed: Callable[[np.ndarray], np.ndarray]
    """body poses (bodies, 7) -> points (points, 3)"""


class Camera:
    """Looks at a take with the light of a bright day. skin: as one smooth body. back: where from, as
    `camera.BACK`; fills: share of the height that the player takes up."""

    def __init__(
        self,
        take: Take,
        size: tuple[int, int] = (360, 450),
        *,
        skin: bool = True,
        samples: int = 2,
        back: Vector = camera.BACK,
        fills: float = FILLS,
        device: str = "cpu",
    ):
        if len(take.worlds) != 1:
            raise ValueError(f"a film is of one world; the take has {len(take.worlds)}")
        self.take, self.size, self.samples = take, size, samples
        parts = list(_parts(take, skin and take.model is not None))
        starts = np.cumsum([0, *(len(part.posed(take.worlds[0, 0])) for part in parts)])
        self._parts = parts
        self._faces = np.concatenate([part.faces + start for part, start in zip(parts, starts)])
        self._colours: Any = wp.array(
            np.concatenate([part.colours for part in parts]).astype(np.float32), dtype=wp.vec3, device=device
        )
        self._corners: Any = wp.array(self._faces.astype(np.int32).ravel(), dtype=int, device=device)
        self._out = wp.zeros(size[::-1], dtype=wp.vec3, device=device)
        player = [b for b, name in enumerate(take.body_names) if name != take.ball]
        self._poses, _ = camera.following(take, player, back, fills, size[0] / size[1])

    def _points(self, frame: int) -> np.ndarray:
        return np.concatenate([part.posed(self.take.worlds[0, frame]) for part in self._parts])

    def picture(self, frame: int) -> Image.Image:
        """What is seen in a frame."""
        points = self._points(frame)
        device = self._out.device
        # built anew, as bounds that are refitted grow loose where the ball goes away: ten times as slow
        mesh = wp.Mesh(wp.array(points.astype(np.float32), dtype=wp.vec3, device=device), self._corners)
        shading: Any = wp.array(normals(points, self._faces).astype(np.float32), dtype=wp.vec3, device=device)
        wp.launch(
            kernel.photograph,
            dim=self._out.shape,
            inputs=[mesh.id, shading, self._colours, self._look(frame), self.samples, self._out],
            device=device,
        )
        linear = np.clip(self._out.numpy(), 0.0, 1.0)
        return Image.fromarray(np.round(255.0 * linear ** (1.0 / 2.2)).astype(np.uint8))

    def _look(self, frame: int) -> kernel.Look:
        pose, (width, height) = self._poses[frame], self.size
        right, up, back = Rotation.from_quat(pose[3:]).as_matrix().T
        half = 0.5 * camera.HEIGHT / camera.FOCAL
        look = kernel.Look()
        look.eye, look.ahead = wp.vec3(*pose[:3]), wp.vec3(*-back)
        look.right, look.up = wp.vec3(*(half * width / height * right)), wp.vec3(*(half * up))
        look.sun, look.disc = wp.vec3(*(SUN / np.linalg.norm(SUN))), DISC
        look.sunlight, look.sky, look.bounce = wp.vec3(*SUNLIGHT), wp.vec3(*SKY), wp.vec3(*BOUNCE)
        look.floor, look.lines, look.fog = wp.vec3(*FLOOR), wp.vec3(*LINES), FOG
        look.beyond = wp.vec3(*BEYOND)
        return look


def _parts(take: Take, skin: bool) -> Iterable[Part]:
    built = skins.of(take.model) if skin and take.model is not None else None
    if built is not None:
        palette = np.array([built.colours[name][:3] for name in built.regions])
        yield Part(built.mesh.faces, palette[built.region], built.posed)
    for body, name in enumerate(take.body_names):
        own = [s for s in take.shapes if s.body == body and s.kind != "plane"]
        if not own or (built is not None and name != take.ball):
            continue
        for mesh, colour in figure.coloured(own, name == take.ball):
            yield Part(mesh.faces, np.tile(colour, (len(mesh.faces), 1)), _moved(mesh, body))


def _moved(mesh: Mesh, body: int) -> Callable[[np.ndarray], np.ndarray]:
    def posed(body_q: np.ndarray) -> np.ndarray:
        return np.asarray(Rotation.from_quat(body_q[body, 3:]).apply(mesh.points) + body_q[body, :3])

    return posed


def frame_count(take: Take, rate: float = RATE) -> int:
    """Pictures of a film of all of a take."""
    return len(range(0, len(take.worlds[0]), _stride(take, rate)))


def _stride(take: Take, rate: float) -> int:
    return max(1, round(take.fps / rate))


def write_film(
    path: str | Path,
    take: Take,
    *,
    rate: float = RATE,
    first: int = 0,
    count: int | None = None,
    progress: Callable[[int], object] | None = None,
    **options: object,
) -> Path:
    """Write frames of a take, `count` of them from `first` on (all), as an animated .webp or .gif that begins
    anew for ever; the file appears whole or not at all. rate: [Hz] at most, as near to it as whole frames
    allow. options: of `Camera`. Raises TakeError."""
    path = check_writable(path, SUFFIXES)
    last = len(take.worlds[0]) if count is None else min(len(take.worlds[0]), first + count)
    stride = _stride(take, rate)
    seen = Camera(take, **options)  # type: ignore[arg-type]
    pictures = []
    for frame in range(first, last, stride):
        pictures.append(seen.picture(frame))
        if progress:
            progress(len(pictures))
    if not pictures:
        raise TakeError(path, f"there is no frame {first}: the take has {len(take.worlds[0])}")
    shown = round(1000.0 * stride / take.fps)
    with whole(path) as part:
        pictures[0].save(
            part,
            format=path.suffix[1:].upper(),
            save_all=True,
            append_images=pictures[1:],
            duration=shown,
            loop=0,
            quality=QUALITY,
            method=4,
        )
    return path
