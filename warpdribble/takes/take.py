"""A simulated take as USD: what moved, as anyone's viewer shows it, and what it takes to simulate it again.

Z up, metres, kilograms, one time code per frame, `/World` as the default prim with the player, the ball and
the court below it. Every moving body is one Xform with translate and orient, as default value (frame 0) and
as time samples; what is seen are meshes with normals, a bound UsdPreviewSurface and displayColor. Where the
model is known, UsdPhysics says the rest (`usdphysics`). Read `docs/takes.md` for how it opens where.
"""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from pxr import Sdf, Tf, Usd, UsdUtils

from ..sims.files import check_folder, whole
from ..sims.model import Model, Shape
from . import camera, crowd, figure, scene
from .usdjoints import left_out

SUFFIXES = (".usda", ".usdc", ".usdz")
LAYERS = {"animation": "usdc", "physics": "usda", "scene": "usdc"}
"""Files beside a layered take, `<take>.<layer>.<suffix>`, strongest first."""


class TakeError(ValueError):
    """A take that cannot be written; the message is one line with the file and the reason."""

    def __init__(self, path: str | Path, reason: str) -> None:
        super().__init__(f"{path}: {reason}")


@dataclass(frozen=True)
class Take:
    """Bodies and shapes over time, from plain arrays."""

    body_names: list[str]
    shapes: list[Shape]
    """As `sims.Model.shapes`."""
    body_q: np.ndarray
    """(frames, bodies, 7) or (worlds, frames, bodies, 7) [m, -], position and quaternion xyzw of each body
    frame in its world."""
    fps: float
    """Frames per second."""
    ball: str = "ball"
    """Name of the body shown as `/World/Ball`; all others belong to `/World/Player`."""
    notes: dict[str, str] = field(default_factory=dict)
    """Where the take comes from; stored as the layer's custom data."""
    model: Model | None = None
    """What the bodies are of; without it a take has no physics and no skin."""
    reference: np.ndarray | None = None
    """(frames, bodies, 7) [m, -] of a take of one world: what it should have done; the replay's ghost."""

    def __post_init__(self) -> None:
        shape, count = np.shape(self.body_q), len(self.body_names)
        if len(shape) not in (3, 4) or shape[-2:] != (count, 7):
            raise ValueError(
                f"body_q is {shape}, should be (frames, {count}, 7) or (worlds, frames, {count}, 7)"
            )
        if 0 in shape:
            raise ValueError(f"body_q is {shape}: a take needs at least one frame of one body")
        if not np.isfinite(self.body_q).all():
            frame = int(np.argwhere(~np.isfinite(self.body_q))[0][-3])
            raise ValueError(f"body_q holds values that are not finite, first in frame {frame}")
        if np.any(np.linalg.norm(self.body_q[..., 3:], axis=-1) < 0.5):
            raise ValueError("body_q holds quaternions of length 0")
        if not (np.isfinite(self.fps) and self.fps > 0.0):
            raise ValueError(f"fps is {self.fps}, should be above 0")
        if self.reference is not None and np.shape(self.reference) != np.shape(self.body_q):
            raise ValueError(f"reference is {np.shape(self.reference)}, should be as body_q, {shape}")
        if self.model is not None and list(self.model.body_names) != list(self.body_names):
            raise ValueError("body_names are not those of the model")

    @classmethod
    def of(
        cls,
        model: Model,
        body_q: np.ndarray,
        fps: float,
        *,
        notes: dict[str, str] | None = None,
        reference: np.ndarray | None = None,
    ) -> Take:
        """A take of a model, with its bodies, shapes and physics."""
        names, notes = list(model.body_names), notes or {}
        return cls(names, model.shapes, body_q, fps, notes=notes, model=model, reference=reference)

    @property
    def worlds(self) -> np.ndarray:
        """(worlds, frames, bodies, 7), whichever way body_q was given."""
        return self.body_q if np.ndim(self.body_q) == 4 else np.asarray(self.body_q)[None]

    def world(self, index: int) -> Take:
        """The take of one world alone."""
        return replace(self, body_q=self.worlds[index])


def check_writable(path: str | Path, suffixes: tuple[str, ...] = SUFFIXES) -> Path:
    """The path, once its suffix is known and its folder is there (it is made) and takes files.
    Raises TakeError."""
    path = Path(path)
    if path.suffix not in suffixes:
        raise TakeError(path, f"name the output with one of {', '.join(suffixes)}")
    try:
        if path.is_dir():
            raise TakeError(path, "is a folder; give a file name")
        check_folder(path.parent)
        with contextlib.suppress(FileNotFoundError):
            os.lstat(path)  # says whether the name is too long, or none
    except (OSError, ValueError) as error:
        if isinstance(error, TakeError):
            raise
        raise TakeError(path, f"cannot be written: {getattr(error, 'strerror', None) or error}") from None
    return path


def layer_files(path: Path) -> dict[str, Path]:
    """The files beside a layered take, by layer."""
    return {name: path.with_suffix(f".{name}.{kind}") for name, kind in LAYERS.items()}


def write_take(
    path: str | Path,
    take: Take,
    *,
    skin: bool = False,
    joints: Literal["revolute", "d6", "spherical"] = "revolute",
    layered: bool | None = None,
    spacing: float = 3.0,
) -> Path:
    """Write a take as .usda, .usdc or .usdz; the file appears whole or not at all. Raises TakeError.

    skin: one smooth skinned body over the player (UsdSkel) instead of a mesh per body. joints: how ball
    joints are said in UsdPhysics, see `usdjoints`. layered: `take.usda` over `take.animation.usdc`,
    `take.physics.usda` and `take.scene.usdc` instead of one file; by default a .usda is, as samples have no
    place in text, and .usdc and .usdz are one file. spacing: [m] between worlds, which stand in a square.
    """
    path = check_writable(path)
    layered = path.suffix == ".usda" if layered is None else layered
    if layered and path.suffix == ".usdz":
        raise TakeError(path, "a package is one file; write layers as .usda or .usdc")
    if skin and take.model is None:
        raise TakeError(path, "a skin needs the take's model")
    try:
        with whole(path) as part:
            layer = part.with_suffix(".usdc") if path.suffix == ".usdz" else part
            _write(layer, take, skin, joints, layered, spacing)
            if path.suffix == ".usdz":
                if not UsdUtils.CreateNewUsdzPackage(str(layer), str(part)):
                    raise TakeError(path, "the usdz package could not be made")
                layer.unlink()
    except OSError as error:
        raise TakeError(path, f"cannot be written: {error.strerror or error}") from None
    return path


def validate(path: str | Path) -> list[str]:
    """What OpenUSD's own validators say against a file: one line each, empty when it is clean.

    Wheels of usd-core up to 25.11 miss the file that names UsdPreviewSurface, and hold it against every take:
    that is left out.
    """
    from pxr import UsdValidation

    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    stage = Usd.Stage.Open(str(path))
    try:
        errors = context.Validate(stage)
    except Tf.ErrorException:  # said once, where the file is missing
        errors = context.Validate(stage)
    said = [f"{e.GetName()}: {e.GetMessage()}" for e in errors]
    return [s for s in said if not s.startswith("MissingShaderIdInRegistry: shaderId 'UsdPreviewSurface'")]


def _write(path: Path, take: Take, skin: bool, joints: str, layered: bool, spacing: float) -> None:
    """A stage is built in memory and exported, so that no layer of a used name is in the way."""
    root = Sdf.Layer.CreateAnonymous(".usda" if path.suffix == ".usda" else ".usdc")
    stage = Usd.Stage.Open(root)
    layers = dict.fromkeys(LAYERS, root)
    if layered:
        layers = {name: Sdf.Layer.CreateAnonymous(f".{kind}") for name, kind in LAYERS.items()}
        root.subLayerPaths = [layer.identifier for layer in layers.values()]
    frames = take.worlds.shape[1]
    for layer in {root, *layers.values()}:
        scene.set_metadata(layer, frames, take.fps)
    lost = left_out(take.model, joints) if take.model else []
    notes = take.notes | ({"left out": "; ".join(lost)} if lost else {})
    root.customLayerData = {str(k): str(v) for k, v in notes.items()}

    edit = {name: Usd.EditTarget(layer) for name, layer in layers.items()}
    stage.SetEditTarget(edit["scene"])
    scene.define_world(stage)
    if len(take.worlds) == 1:
        figure.add(stage, "/World", take.world(0), edit, skin, joints)
        places = take.worlds
    else:
        places = crowd.add(stage, take, edit, skin, joints, spacing)
    stage.SetEditTarget(edit["scene"])
    scene.add_surroundings(stage, places[..., :3].reshape(-1, 3))
    camera.add(stage, take, edit, places)
    figure.add_static(stage, take, edit)
    del stage
    if layered:
        names = layer_files(path)
        for name, layer in layers.items():
            _export(layer, names[name])
        root.subLayerPaths = [f"./{file.name}" for file in names.values()]
    _export(root, path)


def _export(layer: Sdf.Layer, path: Path) -> None:
    try:
        done = layer.Export(str(path))
    except Tf.ErrorException as error:
        raise OSError(None, str(error).splitlines()[0]) from None
    if not done:
        raise OSError(None, "the layer could not be exported")
