"""How the body goes along with a dribble: swings of its parts about their means, once a push.

Measured on recorded dribbles in place, put on the player (`tests/sims/authored/test_breath.py`). CMU
06_10 and 06_12 dribble upright with one hand at 1.25 Hz; BallPlay-M's 044 lleg_2 and 041 pick2back_7 go low,
from hand to hand, at 1.5 Hz. Half of the way of a mean cycle's first harmonic, @ when it is at its top, in
cycles after the ball leaves the hand:

| | 06_10 | 06_12 | lleg_2 | pick2back_7 |
|---|---|---|---|---|
| pelvis' height [cm] | 0.2 @ .57 | 0.3 @ .40 | 4.2 @ .60 | 4.1 @ .62 |
| pelvis' pitch [degrees] | 0.7 @ .95 | 0.4 @ .61 | 2.2 @ .60 | 5.1 @ .71 |
| torso's pitch | 0.5 @ .93 | 1.0 @ .37 | 1.8 @ .13 | 2.2 @ .88 |
| torso's yaw to the left | 3.6 @ .08 | 3.0 @ .21 | 2.7 @ .91 | 2.0 @ .00 |
| torso's roll to the right | 1.8 @ .22 | 1.6 @ .29 | | |
| head's pitch | 1.0 @ .16 | 0.6 @ .19 | 0.7 @ .66 | 2.6 @ .63 |
| shoulder's height [cm] | not recorded | | 0.5 @ .44 | 1.4 @ .67 |
| free upper arm, forward | 3.4 @ .03 | 3.9 @ .02 | | |
| free elbow | 10.5 @ .02 | 5.7 @ .08 | | |

The authored dribble lies between the two kinds. Second harmonics are a tenth to a third of that, and left
out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Swing = tuple[float, float]
"""Half of the way, and when it is at its top, in cycles after the ball leaves the hand."""


@dataclass(frozen=True)
class Breath:
    """Swings of a dribble with the right hand. Lengths in metres, angles in degrees, in the world."""

    up: Swing = (0.022, 0.60)
    forward: Swing = (0.008, 0.60)
    left: Swing = (0.005, 0.25)
    """The pelvis."""
    pelvis: Swing = (2.2, 0.65)
    torso: Swing = (1.8, 0.05)
    """Forward bend, as `Dribble.lean` is."""
    yaw: Swing = (3.5, 0.10)
    """Of the torso, to the left."""
    roll: Swing = (1.7, 0.25)
    """Of the torso, its right side down."""
    head: Swing = (0.8, 0.18)
    """Below the horizon."""
    face: Swing = (0.0, 0.0)
    """Of the head, to the left."""
    shoulders: Swing = (4.0, 0.60)
    """The collar bones, up: 1 cm at the shoulder."""
    arm: Swing = (4.0, 0.03)
    """The free upper arm, forward."""
    elbow: Swing = (8.0, 0.05)
    """Of the free arm."""


BREATH = Breath()


def swing(one: Swing, turns: np.ndarray, rate: float = 1.0) -> np.ndarray:
    """(frames,) of a harmonic of so many periods a cycle; turns: (frames,) cycles since the ball left."""
    half, top = one
    return half * np.cos(2.0 * np.pi * rate * (turns - top))
