"""A run becomes a controller that ships: small, and without what only learning needs.

    python -m warpdribble.reports.ship RUN assets/controllers [NAME]

keeps the graph, the legs and the last stage that was learned, in single precision, networks in half, and
a few states to start from. It must then still do what docs/policies.md says.
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import numpy as np

from ..learning.methods import STAGES
from ..learning.runs.files import write_arrays
from ..learning.runs.folder import CONFIG, GRAPH, RESULT, RUN, SKILL, Run, read_result

STARTS = 64
"""states to start from"""


def ship(run: Path, out: Path) -> None:
    """Write the controller of a run to a folder, which is replaced."""
    one = Run.load(run).learned(STAGES)
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    for name in (RUN, SKILL):
        if (run / name).exists():
            shutil.copy(run / name, out / name)
    with np.load(run / GRAPH) as graph:
        arrays = {name: _single(graph[name]) for name in graph.files}
    np.savez_compressed(out / GRAPH, **arrays)  # type: ignore[arg-type]
    for stage in dict.fromkeys((*(one.stage.uses or ()), one.stage.name)):
        (out / stage).mkdir()
        config = json.loads((run / stage / CONFIG).read_text(encoding="utf-8"))
        (out / stage / CONFIG).write_text(json.dumps(config, indent=2) + "\n", encoding="utf-8")
        result = read_result(run / stage)
        count = len(result["states.k"])
        few = np.random.default_rng(0).permutation(count)[:STARTS]
        small = {name: part[few] if name.startswith("states.") else part for name, part in result.items()}
        write_arrays(
            out / stage / RESULT,
            {
                name: _half(part) if name.startswith("network.") else _single(part)
                for name, part in small.items()
            },
        )


def _single(part: np.ndarray) -> np.ndarray:
    return part.astype(np.float32) if part.dtype == np.float64 and part.ndim else part


def _half(part: np.ndarray) -> np.ndarray:
    return part.astype(np.float16)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit("usage: python -m warpdribble.reports.ship RUN FOLDER [NAME]")
    source = Path(sys.argv[1])
    label = sys.argv[3] if len(sys.argv) > 3 else Run.load(source).info["skill"]["name"]
    ship(source, Path(sys.argv[2]) / label)
