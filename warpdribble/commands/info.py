"""`warpdribble info`: what a report of a fault needs to say of the machine."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from .console import quiet_warp, say, warp_begins

PACKAGES = ("warp-lang", "numpy", "scipy", "usd-core", "mujoco-core", "trimesh", "torch", "onnx", "gymnasium")
"""Whose versions matter; the last ones need not be there."""


@dataclass
class Info:
    """Say versions, processor, devices and folders: what a report of a fault should hold."""

    def run(self) -> int:
        for label, text in _lines():
            say(f"{label:10}{text}")
        return 0


def _lines() -> Iterator[tuple[str, str]]:
    import warp

    from .. import __version__
    from ..clips.data import SETS, data_folder, entries
    from ..sims.worlds.batch import widest_lanes
    from ..sims.worlds.cores import usable_cores

    quiet_warp()
    yield "version", f"warpdribble {__version__} in {Path(__file__).parents[1]}"
    yield "python", f"{platform.python_version()} ({sys.executable})"
    yield "system", platform.platform()
    yield "packages", ", ".join(f"{name} {_version(name)}" for name in PACKAGES)
    cores = f"{usable_cores()} of {os.cpu_count()} threads to use"
    yield "processor", f"{processor()}: {cores}, {widest_lanes()} worlds in a register"
    for device in warp.get_devices():
        if device.is_cuda:
            yield "device", f"{device.alias}: {device.name}, {device.total_memory / 2**30:.0f} GiB"
    if not warp.is_cuda_available():
        yield "device", f"cpu alone{': ' if warp_begins() else ''}{warp_begins()}"
    yield "kernels", _folder(Path(str(warp.config.kernel_cache_dir)))
    data = data_folder()
    yield "data", _folder(data)
    for name in SETS:
        files = entries(name)
        there = sum((data / entry.file).exists() for entry in files)
        yield "", f"{name}: {there} of {len(files)}{'' if there else f' (warpdribble fetch {name})'}"


def processor() -> str:
    """The processor's name."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "-"


def _folder(path: Path) -> str:
    """A folder, and how much is in it."""
    if not path.is_dir():
        return f"{path} (not there yet)"
    size = sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
    return f"{path} ({size / 2**20:.0f} MiB)"
