"""A contact sheet of every authored clip.

python -m warpdribble.reports.authored [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

from ..sims.authored import AUTHORED, authored_clip
from ..sims.model import Model, pose
from ..takes import Take, write_sheet


def main(folder: Path) -> None:
    """Draw them into a folder, which is made."""
    model = Model.load("player")
    folder.mkdir(parents=True, exist_ok=True)
    for name in AUTHORED:
        clip = authored_clip(model, name)
        body_q = pose.forward(model, clip.reference.joint_q)
        take = Take(list(model.body_names), model.shapes, body_q, 1.0 / model.timestep)
        hands = (("right hand", "r_hand"), ("left hand", "l_hand"))
        heights = {label: body_q[:, model.body(body), 2] for label, body in hands}
        contacts = {"ball on left hand": clip.ball.touch[:, 0], "ball on right hand": clip.ball.touch[:, 1]}
        write_sheet(folder / f"{name}.png", take, heights, contacts, f"authored: {name}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/authored"))
