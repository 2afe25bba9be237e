"""When the hands have the ball, told from the hands' motion alone (the set H of P1 5.1).

At every moment nobody has a ball, or the left hand, the right hand or both have it, or it is on its way from
a push over the ground to a hand. Each of these costs or earns something, by what the hands do; the cheapest
story of the whole clip is told (the likeliest path of a hidden semi-Markov model, in costs without unit). A
clip in which every story with a ball costs more than none has no ball.

The costs were chosen on every second of BallPlay-M's clips and of CMU's, `warpdribble.reports.ball` judges
them on the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from .hands import SMOOTH, Hands
from .lattice import Arc, cheapest
from .pushes import LEAVES, LONGEST, find_catch, find_pushes

NONE, LEFT, RIGHT, BOTH = range(4)

PUSHED = 3.0
"""A sure push earns this, a sure swing costs it."""
UNSEEN = 1.0
"""A catch beyond the clip's end costs this."""
BEGINS, COMES, LOST = 1.5, 4.0, 2.0
"""of a ball that is there from the start or taken up with both hands, that comes to one hand, that goes."""
CARRIED, STICKS = 0.2, 1.0
"""[1/s] of a ball in one hand, which hardly shows, and of one that would fall from it."""
GRIP, GRIP_SPREAD = -0.4, 0.2
"""[-] share of its weight with which a ball lies on the palm when it may or may not fall, and how much less
makes it sure."""
HELD = 12.0
"""[1/s] that a ball between two hands earns, or costs when the hands cannot hold one."""
GAP, GAP_SPREAD = 0.25, 0.06
"""[m] between the centres that a ball would have at each hand, when there may or may not be one, and how much
less makes it sure."""
PARTING, PARTING_SPREAD = 0.6, 0.4
"""[m/s] The same of how fast the palms part ..."""
CLOSING, CLOSING_SPREAD = 0.4, 0.2
"""... and come together: they have no ball between them yet."""
PASSING, PASSING_SPREAD = 2.0, 0.5
"""[m/s] The same of one hand's velocity seen from the other."""
THICK, THICK_SPREAD = 0.18, 0.02
"""[m] The same of the palms' distance, which cannot be less than a ball."""
PARTS = 0.4
"""of one hand's letting go of a held ball, or coming to it."""
OVER, OVER_NEAR = 4.0, 0.4
"""of a ball that is put from one hand into the other, and [m] how near they have to be."""
THROW, THROW_SPREAD, THROWN = 0.3, 0.6, -1.5
"""[m/s] at which a palm goes the way it looks when it may or may not throw, how much more makes it sure, and
what a sure throw costs."""
THROWS_ABOVE = -0.15
"""[m] A throw leaves from above this height over the shoulder."""


@dataclass(frozen=True)
class Flight:
    """The ball on its way over the ground from one hand to the same or the other."""

    release: int
    """Row at which it leaves ..."""
    catch: int
    """... and is met; the row after the last when that lies beyond the clip."""
    hand: int
    next_hand: int


@dataclass(frozen=True)
class Possession:
    touch: np.ndarray
    """(frames, 2) bool: the left, the right hand has the ball."""
    flights: tuple[Flight, ...]


def infer(hands: Hands) -> Possession:
    """Who has the ball when. With nothing to show that there is a ball, nobody does."""
    start = np.array([0.0, BEGINS, BEGINS, BEGINS])
    way, taken, _ = cheapest(start, _stay(hands), _change(hands), _flights(hands))
    touch = np.stack([(way == LEFT) | (way == BOTH), (way == RIGHT) | (way == BOTH)], axis=1)
    flights = [Flight(arc.leaves, arc.comes, arc.state - LEFT, arc.next_state - LEFT) for arc in taken]
    return Possession(touch, tuple(flights))


def between_hands(hands: Hands) -> np.ndarray:
    """(frames,) from -1 (no ball fits between the hands) to 1 (they are as if they held one)."""
    gap = np.linalg.norm(hands.centre[:, 0] - hands.centre[:, 1], axis=1)
    passing = np.linalg.norm(hands.velocity[:, 0] - hands.velocity[:, 1], axis=1)
    thick = np.linalg.norm(hands.palms[:, 0] - hands.palms[:, 1], axis=1)
    smooth = gaussian_filter1d(thick, SMOOTH / hands.timestep, mode="nearest")
    parting = np.gradient(smooth, hands.timestep) if len(thick) > 1 else 0.0 * thick
    margin = np.minimum.reduce(
        [
            (GAP - gap) / GAP_SPREAD,
            (PARTING - parting) / PARTING_SPREAD,
            (CLOSING + parting) / CLOSING_SPREAD,
            (PASSING - passing) / PASSING_SPREAD,
            (thick - THICK) / THICK_SPREAD,
        ]
    )
    return np.clip(margin, -2.0, 1.0)


def _stay(hands: Hands) -> np.ndarray:
    """(frames, 4) what each state costs at each row."""
    cost = np.zeros((len(hands.centre), 4))
    falls = np.clip((GRIP - hands.grip) / GRIP_SPREAD, 0.0, 1.0)
    cost[:, [LEFT, RIGHT]] = CARRIED + STICKS * falls
    cost[:, BOTH] = -HELD * between_hands(hands)
    return cost * hands.timestep


def _change(hands: Hands) -> np.ndarray:
    """(frames, 4, 4) what it costs to go from one state to another at each row."""
    cost = np.zeros((len(hands.centre), 4, 4))
    cost[:, NONE, BOTH] = BEGINS
    cost[:, NONE, LEFT] = cost[:, NONE, RIGHT] = COMES
    near = np.linalg.norm(hands.palms[:, 0] - hands.palms[:, 1], axis=1) < OVER_NEAR
    cost[:, LEFT, RIGHT] = cost[:, RIGHT, LEFT] = np.where(near, OVER, np.inf)
    lost = np.stack([_lost(hands, hand) for hand in (0, 1)])
    for hand, state in enumerate((LEFT, RIGHT)):
        cost[:, state, BOTH] = cost[:, BOTH, state] = PARTS
        cost[:, state, NONE] = lost[hand]
    cost[:, BOTH, NONE] = lost.min(axis=0)
    return cost


def _lost(hands: Hands, hand: int) -> np.ndarray:
    """(frames,) what it costs that a hand's ball is gone from a row on: little where the hand has thrown."""
    push, up = hands.push[:, hand], hands.velocity[:, hand, 2]
    throws = (hands.centre[:, hand, 2] > hands.shoulder[:, hand] + THROWS_ABOVE) & (up > -0.3)
    throws[1:-1] &= (push[1:-1] >= push[:-2]) & (push[1:-1] > push[2:])
    throws[[0, -1]] = False
    surety = np.where(throws, np.clip((push - THROW) / THROW_SPREAD, 0.0, 1.0), 0.0)
    later = round(LEAVES / hands.timestep)
    surety = np.concatenate([np.zeros(later), surety])[: len(push)]
    return LOST + (THROWN - LOST) * surety


def _flights(hands: Hands) -> list[Arc]:
    """Every way that a ball may take over the ground."""
    arcs = []
    frames = len(hands.centre)
    for push in find_pushes(hands):
        leaves = push.row + round(LEAVES / hands.timestep)
        cost = -PUSHED * push.surety
        if leaves >= frames:
            continue
        if frames - leaves < LONGEST / hands.timestep:
            arcs.append(Arc(leaves, frames, LEFT + push.hand, LEFT + push.hand, cost + UNSEEN))
        for hand in (0, 1):
            catch = find_catch(hands, push, hand)
            if catch is not None:
                arcs.append(Arc(leaves, catch.row, LEFT + push.hand, LEFT + hand, cost + catch.cost))
    return arcs
