"""How kernel modules are compiled, so that the next process finds all of them in Warp's cache."""

import importlib
from pathlib import Path

import warp as wp

SHARING = ("place", "probe", "step", "observe", "loose", "port")
"""Modules that share functions."""


def cached(module: str, device: wp.Device) -> bool:
    """Whether a module's kernels lie compiled in Warp's cache, so that loading them takes no compiler."""
    name = wp.get_module(module).get_module_identifier(
        1 if device.is_cpu else None
    )  # as Warp launches on each
    return any(Path(str(wp.config.kernel_cache_dir), name).glob("*.o" if device.is_cpu else "*.sm*"))


def compiled(module: str, device: wp.Device) -> None:
    """Compile and load a module's kernels. Before any are compiled, those that share functions are named:
    Warp names them by hashing what compiling changes, and would not know them again."""
    if not cached(module, device):
        for name in SHARING:
            cached(importlib.import_module(f"{__package__}.{name}").__name__, device)
    wp.load_module(module, device=device)
