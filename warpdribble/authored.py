"""Clips written by our own code instead of recorded: what a fresh machine has without any download.

    python -m warpdribble.authored FOLDER

draws a contact sheet of each. They are made when asked for, in well under a second, so none is stored.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .author import dribble_right
from .author_carry import carry
from .author_switch import switch
from .author_waist import waist
from .sims.ball import Ball, find_checkpoints
from .sims.hands import find_hands
from .sims.reference import Reference


@dataclass(frozen=True)
class Authored:
    """A cyclic reference, its last row the first one again, and its ball, which is in its coordinates too."""

    reference: Reference
    ball: Ball


def _dribble(model) -> tuple[Reference, np.ndarray, np.ndarray]:
    clip = dribble_right(model)
    times = clip.reference.timestep * np.arange(clip.reference.frame_count)
    touch = np.zeros((len(times), 2), bool)
    touch[:, 1] = (times >= clip.contact[0]) | (times == 0.0)
    place = model.q_slice("ball").start
    return clip.reference, clip.reference.joint_q[:, place : place + 3], touch


AUTHORED: dict[str, Callable] = {
    "carry": carry,
    "dribble_right": _dribble,
    "waist": waist,
    "switch_hands": switch,
}


def authored(model, name: str) -> Authored:
    """An authored clip on the player. Raises KeyError for a name that is none."""
    reference, path, touch = AUTHORED[name](model)
    joint_q = reference.joint_q.copy()
    place = model.q_slice("ball").start
    joint_q[:, place : place + 3] = path
    reference = replace(reference, joint_q=joint_q)
    centre = find_hands(model, reference).centre
    rows = _tops(path[:, 2], touch)
    heights = tuple(float(centre[row, touch[row], 2].mean()) for row in rows)
    return Authored(reference, Ball(path, touch, rows, heights))


def _tops(height: np.ndarray, touch: np.ndarray) -> tuple[int, ...]:
    """Checkpoints of a cycle: contacts may run over its seam, and a ball that is never let go has its highest
    point as its only one."""
    count = len(height) - 1
    if touch.any(axis=1).all():
        return (int(np.argmax(height[:-1])),)
    twice = np.concatenate([height[:-1], height[:-1], height[:1]])
    both = np.concatenate([touch[:-1], touch[:-1], touch[:1]])
    return tuple(sorted({row % count for row in find_checkpoints(twice, both)}))


def main(folder: Path) -> None:
    """Draw every authored clip."""
    from .sheet import write_sheet
    from .sims import Model, pose
    from .take import Take

    model = Model.load("player")
    folder.mkdir(parents=True, exist_ok=True)
    for name in AUTHORED:
        clip = authored(model, name)
        body_q = pose.forward(model, clip.reference.joint_q)
        take = Take(list(model.body_names), model.shapes, body_q, 1.0 / model.timestep)
        hands = (("right hand", "r_hand"), ("left hand", "l_hand"))
        heights = {label: body_q[:, model.body(body), 2] for label, body in hands}
        contacts = {"ball on left hand": clip.ball.touch[:, 0], "ball on right hand": clip.ball.touch[:, 1]}
        write_sheet(folder / f"{name}.png", take, heights, contacts, f"authored: {name}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/authored"))
