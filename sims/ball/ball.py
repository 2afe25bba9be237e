"""The kinematic ball of a reference: where it would be, which hands have it when, and what an optimiser holds
on to (P1 5.1): the soft set H, the checkpoints, the reference heights.

It is inferred from the hands' motion alone, or, where the recording has a ball, taken from there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..model import Model
from ..recording import Motion
from ..reference import Reference
from ..retarget.retarget import Retargeted, goal_joints
from ..signals import runs
from . import flight
from .hands import Hands, find_hands
from .possession import Flight, infer
from .recorded import recorded_touch

ALIKE, BOUNCED = 0.7, 0.2
"""[m] A recorded ball that comes lower than the second has bounced."""


@dataclass(frozen=True)
class Ball:
    """The ball of one reference, a row per time step."""

    path: np.ndarray
    """(frames, 3) [m], the centre."""
    touch: np.ndarray
    """(frames, 2) bool: the left, the right hand has it (H of P1 5.1)."""
    checkpoints: tuple[int, ...]
    """Rows at which the ball is highest between two pushes."""
    heights: tuple[float, ...]
    """[m], h_ref of P1 Eq. 8 at each checkpoint: of the hand, less the ball's radius along the palm's
    normal."""
    flights: tuple[Flight, ...] = ()
    recorded: bool = False

    def contact(self, timestep: float) -> dict[str, list[tuple[float, float]]]:
        """Hand ("left", "right") -> (from, to) [s] of every contact."""
        found = {}
        for hand, name in enumerate(("left", "right")):
            parts = [(a * timestep, b * timestep) for a, b in runs(self.touch[:, hand])]
            if parts:
                found[name] = parts
        return found


def inferred_ball(model: Model, reference: Reference, scale: float = 1.0) -> Ball | None:
    """The ball that the hands of a reference play with, from their motion alone; None when nothing shows
    one. scale: of the model to the person who moved (`Retargeted.scale`), whose ball it was."""
    possession = infer(find_hands(model, reference, scale))
    if not possession.touch.any():
        return None
    hands = find_hands(model, reference)
    path = ball_path(hands, possession.touch, possession.flights)
    rows = find_checkpoints(path[:, 2], possession.touch)
    heights = tuple(_height(hands, possession.touch, row) for row in rows)
    return Ball(path, possession.touch, rows, heights, possession.flights)


def recorded_ball(model: Model, retargeted: Retargeted, motion: Motion) -> Ball | None:
    """The ball as `motion` recorded it, in the world of the motion that was retargeted; None when it has
    none."""
    motion = retargeted.mapping.plain(motion).resample(1.0 / model.timestep)
    if motion.ball is None:
        return None
    joints = goal_joints(model, retargeted.mapping)
    left, right = (joints[hand] for hand in model.roles.both("hands"))
    touch = recorded_touch(motion, (left, right), model.ball_radius)
    hands = find_hands(model, retargeted.reference)
    path = retargeted.scale * motion.ball - retargeted.ground[:, None] * [0.0, 0.0, 1.0]
    _set_on_ground(path, hands.radius)
    rows = find_checkpoints(path[:, 2], touch)
    heights = tuple(_height(hands, touch, row) for row in rows)
    return Ball(path, touch, rows, heights, recorded=True)


def mirrored_ball(ball: Ball) -> Ball:
    """A ball in the mirror, with its contacts on the other hand."""
    flights = tuple(Flight(f.release, f.catch, 1 - f.hand, 1 - f.next_hand) for f in ball.flights)
    return replace(ball, path=ball.path * [1.0, -1.0, 1.0], touch=ball.touch[:, ::-1].copy(), flights=flights)


def _set_on_ground(path: np.ndarray, radius: float) -> None:
    """Bring the bounces of a path (frames, 3) [m] to the ground, in place: the ground under the feet is that
    of another person's ankles. Heights above ALIKE stay, so that the ball stays with the hands."""
    low = path[:, 2] < ALIKE
    lowest = float(path[:, 2].min())
    if lowest < BOUNCED:
        share = (ALIKE - path[low, 2]) / (ALIKE - lowest)
        path[low, 2] = ALIKE - share * (ALIKE - radius)


def ball_path(hands: Hands, touch: np.ndarray, flights: tuple[Flight, ...]) -> np.ndarray:
    """Centres (frames, 3) [m]: with the hand or between the hands that have it, falling and bouncing in its
    flights, thrown where it is let go for good, at its first place before anyone has it."""
    frames = len(touch)
    held = np.any(touch, axis=1)
    weight = np.where(held[:, None], touch, 0.0)
    path = np.einsum("fh,fhk->fk", weight, hands.centre) / np.maximum(weight.sum(axis=1), 1.0)[:, None]
    for first, last in runs(~held):
        if first == 0:
            path[: last + 1] = path[last + 1] if last + 1 < frames else 0.0
            continue
        hand = int(np.argmax(touch[first - 1]))
        velocity = hands.velocity[first - 1, hand]
        times = np.arange(1, last - first + 2) * hands.timestep
        path[first : last + 1] = flight.thrown(path[first - 1], velocity, times, hands.radius)
    for way in flights:
        _fly(path, hands, way)
    return path


def flights_of(touch: np.ndarray) -> tuple[Flight, ...]:
    """The ball's ways between contacts touch (frames, 2): wherever nobody has it in between."""
    free = [(a, b) for a, b in runs(~touch.any(axis=1)) if a > 0]
    last = len(touch) - 1
    return tuple(
        Flight(a, b + 1, int(np.argmax(touch[a - 1])), int(np.argmax(touch[b + 1])))
        for a, b in free
        if b < last
    )


def find_checkpoints(height: np.ndarray, touch: np.ndarray) -> tuple[int, ...]:
    """Rows at which a ball of height (frames,) [m] is highest while hands have it, one per contact; contacts
    that are cut by the clip's ends count when the ball is highest inside them."""
    rows = []
    held = np.any(touch, axis=1)
    for first, last in runs(held):
        row = first + int(np.argmax(height[first : last + 1]))
        inside = first < row < last
        if inside or (first > 0 and last < len(held) - 1):
            rows.append(row)
    return tuple(rows)


def _fly(path: np.ndarray, hands: Hands, way: Flight) -> None:
    """Write one flight into the path, in place: between two hands it bounces once on a straight line."""
    if way.release >= len(path) or way.release < 1:
        return
    start = path[way.release - 1]
    times = np.arange(1, min(way.catch, len(path) - 1) - way.release + 2) * hands.timestep
    if way.catch >= len(path):
        velocity = hands.velocity[way.release - 1, way.hand].copy()
        velocity[2] = -max(flight.speed_to_return(start[2], hands.radius), -velocity[2])
        path[way.release :] = flight.thrown(start, velocity, times[: len(path) - way.release], hands.radius)
        return
    end = hands.centre[way.catch, way.next_hand]
    speed = flight.speed_to_meet(start[2], end[2], times[-1], hands.radius)
    inside = slice(way.release, way.catch + 1)
    path[inside] = start + (times / times[-1])[:, None] * (end - start)
    if np.isfinite(speed):
        path[inside, 2] = flight.Bounce(start[2], float(speed), hands.radius).at(times)


def _height(hands: Hands, touch: np.ndarray, row: int) -> float:
    return float(hands.centre[row, touch[row], 2].mean())
