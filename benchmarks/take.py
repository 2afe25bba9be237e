"""How long a take of the player takes to write: `python -m warpdribble.benchmarks.take`, prints JSON."""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from ..sims import Model
from ..sims.model import pose
from ..takes.take import Take, write_take
from ..web.page import write_replay

FRAMES = 600
ROUNDS = 5


def moving(model: Model, frames: int = FRAMES) -> Take:
    """The player and the ball, every joint turning a little in every frame."""
    rng = np.random.default_rng(0)
    joint_q = np.tile(model.start_q, (frames, 1))
    joint_q += 0.05 * np.sin(np.arange(frames)[:, None] * rng.uniform(0.02, 0.2, model.nq))
    for k in model.quaternions():
        joint_q[:, k : k + 4] /= np.linalg.norm(joint_q[:, k : k + 4], axis=1, keepdims=True)
    return Take.of(model, pose.forward(model, joint_q), 100.0)


def main() -> dict[str, Any]:
    """Medians [s] and sizes [bytes] per way of writing; the first write, which builds meshes, on its own."""
    model = Model.load("player")
    take = moving(model)
    crowd = Take.of(model, np.stack([take.body_q] * 64), 100.0)
    jobs = {
        "usdc": ("a.usdc", lambda p: write_take(p, take)),
        "usda, layered": ("a.usda", lambda p: write_take(p, take)),
        "usdz": ("a.usdz", lambda p: write_take(p, take)),
        "usdc, skin": ("b.usdc", lambda p: write_take(p, take, skin=True)),
        "usdc, 64 worlds": ("c.usdc", lambda p: write_take(p, crowd)),
        "html": ("a.html", lambda p: write_replay(p, take)),
    }
    rows: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, (file, job) in jobs.items():
            spent = []
            for _ in range(ROUNDS + 1):
                began = time.perf_counter()
                job(Path(folder) / file)
                spent.append(round(time.perf_counter() - began, 4))
            size = sum(f.stat().st_size for f in Path(folder).glob(Path(file).stem + ".*usd*"))
            size = size if "usd" in file else (Path(folder) / file).stat().st_size
            rows[name] = {
                "first_s": spent[0],
                "median_s": float(np.median(spent[1:])),
                "bytes": size,
            }
            for other in Path(folder).iterdir():
                other.unlink()
    result = {"frames": FRAMES, "bodies": model.nbody, "rows": rows}
    print(json.dumps(result, indent=1))
    return result


if __name__ == "__main__":
    main()
