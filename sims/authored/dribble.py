"""A dribble written down instead of recorded: standing, right hand, in place, cyclic, the same
every time.

The ball comes first: it falls from the hand, bounces by the law of restitution, meets the hand
again, and is carried up and pushed down so that it leaves as it did a cycle before. The hand stays
on the ball while it has it. The rest of the body stands, leans, looks ahead and goes along with every push
(`breath`); arms and legs are solved for hands and feet.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from ..ball.flight import GRAVITY, Bounce, T
from ..model import Model, pose
from ..reference.reference import Reference, resample_q
from .breath import BREATH, Breath, Swing, swing
from .posture import hang, shrug, turn

Heights = Callable[[np.ndarray], np.ndarray]
HAND_YAW = np.radians(18.0)
"""Of the fingers on the ball, from straight ahead toward the left."""
FREE_ARM = (-14.0, 60.0)
"""[degrees] forward of the free upper arm, bend of its elbow; CMU 06_10 and 06_12 have -31 and 55."""


@dataclass(frozen=True)
class Dribble:
    """Numbers of the authored dribble. Lengths in metres, times in seconds, angles in degrees,
    speeds in m/s."""

    period: float = 0.70
    hold: float = 0.23
    """How long the hand has the ball in a cycle."""
    release_height: float = 0.75
    """Of the ball's centre, where it leaves the hand."""
    restitution: float = 0.8
    lowest_palm: float = 0.755
    """The hand follows through to here before it rises to meet the ball."""
    ball_place: tuple[float, float] = (0.35, -0.28)
    """Forward and left of the middle between the feet."""
    pelvis_height: float = 0.84
    pelvis_back: float = 0.07
    pelvis_left: float = -0.01
    breath: Breath = BREATH
    lean: tuple[float, float, float] = (12.0, 12.0, 11.0)
    """Forward bend of pelvis, lower back and torso."""
    tilt: float = 4.0
    """Of the torso to the right, toward the ball."""
    gaze: float = 12.0
    """Below the horizon."""
    feet: tuple[tuple[float, float, float], ...] = ((0.09, 0.15, 12.0), (-0.09, -0.15, -14.0))
    """Left and right ankle: forward, left, turned out."""
    curl: float = 1.0
    """Of the dribbling fingers: 0 is the model's `flat` pose, 1 its `ready` pose."""
    fingers: tuple[float, float] = (10.0, 34.0)
    """Tilt of the fingers below the horizon, on the ball and after the release."""
    roll: float = 3.5
    """Of the palm on the ball, toward the left."""


@dataclass(frozen=True)
class AuthoredClip:
    """A cyclic reference, its last row the first one again, and when the hand has the ball."""

    reference: Reference
    hand: str
    """Body that dribbles."""
    contact: tuple[float, float]
    """[s] from the first row: the hand catches and releases the ball. The clip begins at a
    release."""
    lowest: float
    """[s] from the first row: the hand is lowest."""
    restitution: float


def dribble_right(model: Model, style: Dribble = Dribble()) -> AuthoredClip:
    """The authored right-hand dribble on the player, at its time step; the ball's path is in its
    coordinates.

    Raises ValueError when no ball could do what the numbers ask for.
    """
    steps = round(style.period / model.timestep)
    times = np.arange(steps + 1) * model.timestep
    period = steps * model.timestep
    style = replace(style, period=period)
    radius = model.ball_radius
    flight, ball_height, palm_height = stroke(style, radius)
    joint_q = np.tile(fingers(model, style.curl), (steps + 1, 1))
    trunk(model, joint_q, style, times / period)
    legs(model, joint_q, style)
    _left_arm(model, joint_q, style.breath, times / period)
    under = np.tile([*style.ball_place, -radius], (steps + 1, 1))
    under[:, 2] += palm_height(times % period)
    snap = np.sin(np.pi * np.minimum(times % period / flight, 1.0) ** 0.7) ** 2
    tilt = np.interp(snap, [0.0, 1.0], style.fingers)
    _right_arm(model, joint_q, under, radius, np.radians(tilt), np.radians(style.roll))
    ball = model.q_slice(model.roles.one("ball_joint"))
    joint_q[:, ball.start : ball.start + 2] = style.ball_place
    joint_q[:, ball.start + 2] = ball_height(times % period)
    joint_q[-1] = joint_q[0]
    lowest = float(times[np.argmin(under[:, 2])])
    return AuthoredClip(
        Reference(joint_q, model.timestep), "r_hand", (flight, period), lowest, style.restitution
    )


@dataclass(frozen=True)
class Push:
    """The ball in the hand: its acceleration is -g - k t. The push grows from nothing, so the hand never has
    to pull."""

    catch: float
    """[m] height at which the hand meets it"""
    back: float
    """[m/s] upward, with which it comes"""
    growth: float
    """[m/s^3], k"""

    def at(self, since: T) -> T:
        """Height [m] `since` seconds after the catch."""
        return self.catch + self.back * since - 0.5 * GRAVITY * since**2 - self.growth * since**3 / 6.0


def release_speed(style: Dribble, radius: float) -> float:
    """The speed [m/s] at which the ball has to leave the hand for the cycle to close.

    Raises ValueError when there is none.
    """
    speeds = np.linspace(0.2, 12.0, 119)
    missed = np.array([_cycle(style, radius, v)[-1] for v in speeds])
    change = np.flatnonzero((missed[:-1] < 0.0) != (missed[1:] < 0.0))
    if not len(change):
        raise ValueError("this dribble has no ball that comes back to the hand in time")
    k = change[0]
    return brentq(lambda v: _cycle(style, radius, v)[-1], speeds[k], speeds[k + 1])


def _cycle(style: Dribble, radius: float, v: float) -> tuple[Bounce, float, Push, float]:
    """A cycle that begins at speed v [m/s]: the bounce, the time from the ground up to the hand [s], the
    push, and the height that is missed at its end [m]."""
    bounce = Bounce(style.release_height, v, radius, style.restitution)
    up = style.period - style.hold - bounce.down
    back, hold = style.restitution * bounce.impact - GRAVITY * up, style.hold
    push = Push(bounce.rising(up), back, 2.0 * (back + v - GRAVITY * hold) / hold**2)
    return bounce, up, push, push.at(hold) - style.release_height


def bounce_of(style: Dribble, radius: float) -> Bounce:
    """The ball of a stroke from the hand to the hand. Raises ValueError when there is none."""
    return Bounce(style.release_height, release_speed(style, radius), radius, style.restitution)


def stroke(style: Dribble, radius: float) -> tuple[float, Heights, Heights]:
    """How long the ball is in flight [s], and heights of the ball and of the palm [m] as functions of the
    time since the release [s]."""
    v = release_speed(style, radius)
    bounce, up, push, _ = _cycle(style, radius, v)
    if min(up, push.growth) < 0.0:
        raise ValueError("this dribble holds the ball too long to push it down")
    flight = bounce.down + up

    def carried(t: np.ndarray) -> np.ndarray:
        return push.at(np.maximum(t - flight, 0.0))

    def ball(t: np.ndarray) -> np.ndarray:
        return np.where(t < flight, bounce.at(t), carried(t))

    touch = style.release_height + radius
    turn = 2.0 * (touch - style.lowest_palm) / v
    empty = CubicHermiteSpline(
        [0.0, turn, flight], [touch, style.lowest_palm, push.catch + radius], [-v, 0.0, push.back]
    )

    def palm(t: np.ndarray) -> np.ndarray:
        return np.where(t < flight, empty(np.minimum(t, flight)), carried(t) + radius)

    return flight, ball, palm


def fingers(model: Model, curl: float, sides: str = "r") -> np.ndarray:
    """The start pose (nq,) with the fingers of these sides part of the way from flat to ready."""
    poses = np.stack([model.keyframes["flat"], model.keyframes["ready"]])
    joint_q = np.array(model.start_q, dtype=float)
    between = resample_q(model, poses, np.array([curl]))[0]
    for joint in model.joint_names:
        if joint[:2] in [f"{side}_" for side in sides] and joint.endswith(("_mcp", "_pip", "_dip")):
            joint_q[model.q_slice(joint)] = between[model.q_slice(joint)]
    return joint_q


def trunk(
    model: Model, joint_q: np.ndarray, style: Dribble, turns: np.ndarray, sideways: float = 1.0
) -> None:
    """Root, back, neck and collar bones: the lean, and what goes along with the push.

    turns: (frames,) cycles since the ball left the hand; sideways: swings to the sides a cycle, a half where
    the hands take turns.
    """
    breath = style.breath

    def aside(one: Swing) -> np.ndarray:
        return swing(one, turns, sideways)

    root = model.q_slice(model.root)
    joint_q[:, root.start] = -style.pelvis_back + swing(breath.forward, turns)
    joint_q[:, root.start + 1] = style.pelvis_left + aside(breath.left)
    joint_q[:, root.start + 2] = style.pelvis_height + swing(breath.up, turns)
    yaw, roll = aside(breath.yaw), style.tilt + aside(breath.roll)
    hips, bent = swing(breath.pelvis, turns), swing(breath.torso, turns) - swing(breath.pelvis, turns)
    below = Rotation.identity()
    for place, lean, pitch, share in (
        (slice(root.start + 3, root.stop), style.lean[0], hips, 0.2),
        (model.q_slice("lower_back"), style.lean[1], 0.5 * bent, 0.4),
        (model.q_slice("torso"), style.lean[2], 0.5 * bent, 0.4),
    ):
        bend = turn(share * yaw, lean + pitch, share * roll)
        joint_q[:, place] = bend.as_quat()
        below = below * bend
    head = turn(aside(breath.face), style.gaze + swing(breath.head, turns), 0.0 * turns)
    joint_q[:, model.q_slice("neck")] = (below.inv() * head).as_quat()
    shrug(model, joint_q, swing(breath.shoulders, turns))


def legs(model: Model, joint_q: np.ndarray, style: Dribble) -> None:
    """Both legs, solved for feet on the ground."""
    zero = model.zero_pose[:, :3]
    for side, (forward, left, out) in zip("lr", style.feet):
        ankle = np.array([forward, left, zero[model.body(f"{side}_foot"), 2]])
        foot = Rotation.from_euler("z", out, degrees=True)
        knee_axis = foot.apply([0.0, 1.0, 0.0])
        pose.place_limb(model, joint_q, f"{side}_knee", ankle, foot, knee_axis)


def _left_arm(model: Model, joint_q: np.ndarray, breath: Breath, turns: np.ndarray) -> None:
    """Hangs beside the body, elbow behind it and hand in front, swinging against the push."""
    ahead = np.radians(FREE_ARM[0] + swing(breath.arm, turns))
    down = np.column_stack([np.sin(ahead), np.full_like(ahead, 0.24), -np.cos(ahead)])
    hang(model, joint_q, "l", down, FREE_ARM[1] + swing(breath.elbow, turns))


def _right_arm(
    model: Model, joint_q: np.ndarray, under: np.ndarray, radius: float, tilt: np.ndarray, roll: float
) -> None:
    """Palm down on a ball centred at `under` (frames, 3) [m], whether there is one or not.

    The fingers point ahead, `tilt` (frames,) [rad] below the horizon.
    """
    hand = model.body("r_hand")
    shape = model.first_shape(hand)
    centre = np.array(shape.pos) - [0.0, 0.0, shape.size[2]]
    lying = Rotation.from_euler("ZYX", np.column_stack([0 * tilt + HAND_YAW, tilt, 0 * tilt + roll]))
    lying = lying * Rotation.from_euler("z", 0.5 * np.pi)  # fingers, -Y in the zero pose, to +X
    palm = under + radius * lying.apply([0.0, 0.0, 1.0])
    wrist = palm - lying.apply(centre)
    elbow_axis = np.array([0.35, -0.80, 0.50])
    pose.place_limb(model, joint_q, "r_elbow", wrist, lying, elbow_axis)
