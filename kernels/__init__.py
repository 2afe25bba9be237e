"""Articulated rigid-body dynamics in Warp: no files, no names of body parts, no learning."""

import importlib
import sys
from types import ModuleType


def program(lanes: int, module: str = "step") -> ModuleType:
    """A kernel module compiled for `lanes` worlds in one `Real` (1, 4, 8 or 16).

    One source serves every lane count: the kernel modules are imported once more through a package
    that shares this folder and says how wide a `Real` is.
    """
    if lanes not in (1, 4, 8, 16):
        raise ValueError(f"lanes must be 1, 4, 8 or 16, not {lanes!r}")
    name = f"{__name__}.x{lanes}"
    if name not in sys.modules:
        package = ModuleType(name, __doc__)
        package.__path__ = __path__
        package.LANES = lanes
        sys.modules[name] = package
    return importlib.import_module(f"{name}.{module}")
