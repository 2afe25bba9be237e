"""From a recorded skeleton to a model: rotations of corresponding joints are copied (P1 7.1), then feet are
kept where they stood and hands brought where they were.

What is copied is how far each segment has turned from the T-pose, seen in the world, so that joints
between the named ones are composed on the way and the two skeletons' joint frames need not agree.
Places are the recording's, scaled by the length of the legs, with the ground brought to z = 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import gaussian_filter1d, median_filter, minimum_filter1d
from scipy.spatial.transform import Rotation

from ..model import Model, pose
from ..recording import anatomy
from ..recording.motion import Motion
from ..reference.reference import Reference
from ..signals import low_pass, low_pass_rotations
from .calibrate import match_limbs, since_rest
from .head import along_neck, told
from .knees import Leg, ease_knees
from .mapping import Mapping, find_mapping
from .planting import Stand, Tread, find_stands, standing
from .reach import brought_within, elbow_axis, joint_range, keep_range, lift_out, lower_root, reach, shrug
from .sole import Foot, find_foot, sole_heights
from .swings import swinging
from .tpose import t_pose

GROUND = (1.6, 0.3)
"""[s] The ground is the lowest that the soles come within the first time, smoothed over the second."""
STIFF = np.radians(1.0)
"""A standing foot that its ankle turns by more than this lifts its heel."""
TOES = 6.0
"""[Hz] Toes bend no faster."""


@dataclass(frozen=True)
class Retargeted:
    """A motion on a model, and what it is to be compared with."""

    reference: Reference
    mapping: Mapping
    scale: float
    """[-] of all the recording's lengths."""
    goals: dict[str, np.ndarray]
    """Body -> (frames, 3) [m], where the recording has its origin, scaled, over ground at z = 0."""
    ground: np.ndarray
    """(frames,) [m] height of the ground in the scaled recording, taken off."""
    toes: dict[str, str | None] = field(default_factory=dict)
    """Foot -> joint of the recording that its toes follow; None where it has none, and toes are straight."""
    stands: dict[str, list[Stand]] = field(default_factory=dict)
    """Foot -> its stands."""
    moved: np.ndarray | None = None
    """(frames, 3) [m] by which the root gave way for the legs to reach, and to do so without jerks."""
    notes: tuple[str, ...] = ()
    """What was guessed or put right of the recording's T-pose, and of its neck."""


def retarget(model: Model, motion: Motion, mapping: Mapping | None = None, ik: bool = True) -> Reference:
    """The motion on the model at the model's time step; see `retargeted`."""
    return retargeted(model, motion, mapping, ik).reference


def retargeted(model: Model, motion: Motion, mapping: Mapping | None = None, ik: bool = True) -> Retargeted:
    """The motion on the model, resampled to a whole number of its steps, the ground at z = 0.

    mapping: None takes the shipped one that fits. ik: False copies rotations only. Bodies the mapping does
    not name keep the angles of the model's start pose (fingers, the ball); only toes are looked for by name.
    Raises MappingError (a ValueError) for a joint or body that is not there.
    """
    mapping = mapping or find_mapping(motion)
    mapping.check_model(model)
    motion = mapping.plain(motion).resample(1.0 / model.timestep)
    motion, notes = t_pose(model, motion, mapping)
    positions, frames = motion.forward()
    positions = positions if motion.positions is None else motion.positions
    scale = leg_scale(model, motion, mapping)
    goals = {b: scale * positions[:, motion.index(j)] for b, j in goal_joints(model, mapping).items()}

    since = since_rest(motion, frames)
    turned = _body_rotations(model, motion, positions, since, mapping)
    if ik and (line := along_neck(model, motion, mapping, positions, since)) is not None:
        head = str(model.roles.head)
        notes, turned[head] = (*notes, *told(turned[head], line)), line
    joint_q = np.tile(np.asarray(model.start_q, dtype=float), (motion.frame_count, 1))
    root = model.body_names[model.joint_body(model.root)]
    if root in mapping.smoothed:
        soft = low_pass_rotations(turned[root].as_quat(), motion.rate, mapping.smoothed[root])
        turned[root] = Rotation.from_quat(soft)
    joint_q[:, model.q_slice(model.root)] = _root(model, goals, mapping, turned)
    if root in mapping.smoothed:
        place = joint_q[:, model.q_slice(model.root)][:, :3]
        place[:] = low_pass(place, motion.rate, mapping.smoothed[root])
    _fill_joints(model, joint_q, turned, mapping.smoothed)
    knees = {model.body_names[pose.limb_bodies(model, knee)[2]]: knee for knee in mapping.legs}
    toes = {name: _toe_joint(model, motion, mapping, name) for name in knees}
    treads = _treads(model, motion, scale * positions, since, joint_q, goals, toes)
    for name, tread in treads.items():
        joint = find_foot(model, name).toe_joint
        joint_q[:, model.q_slice(joint)] = tread.toes[:, None]
        keep_range(model, joint_q, joint)
    ground = _ground(model, treads)
    treads = {name: tread.above(ground) for name, tread in treads.items()}
    joint_q[:, model.q_slice(model.root).start + 2] -= ground
    goals = {body: goal - ground[:, None] * [0.0, 0.0, 1.0] for body, goal in goals.items()}
    reference = Reference(joint_q, model.timestep)
    out = Retargeted(reference, mapping, scale, goals, ground, toes, notes=notes)
    return _with_ik(model, out, treads, knees) if ik else out


def goal_joints(model: Model, mapping: Mapping) -> dict[str, str]:
    """Body of the model -> joint of the recording that lies at its origin."""
    named = dict(mapping.points)
    for hinge, joints in mapping.limbs.items():
        named |= {model.body_names[b]: j for b, j in zip(pose.limb_bodies(model, hinge), joints)}
    return named


def leg_scale(model: Model, motion: Motion, mapping: Mapping) -> float:
    """[-] length of the model's legs over the recorded person's."""
    own = theirs = 0.0
    zero, rest = model.zero_pose[:, :3], motion.rest()[0]
    for knee, joints in mapping.legs.items():
        for a, b in pairwise(pose.limb_bodies(model, knee)):
            own += float(np.linalg.norm(zero[b] - zero[a]))
        for a, b in pairwise(map(motion.index, joints)):
            theirs += float(np.linalg.norm(rest[b] - rest[a]))
    return own / theirs


def _with_ik(model: Model, out: Retargeted, treads: dict[str, Tread], knees: dict[str, str]) -> Retargeted:
    """The motion with feet planted and hands brought to their goals. treads, knees: of each leg by the foot's
    name."""
    joint_q = out.reference.joint_q
    copied = joint_q.copy()
    stands = {name: find_stands(find_foot(model, name), t, model.timestep) for name, t in treads.items()}
    moved, stiff = _plant(model, joint_q, treads, stands, knees)
    if any(angle.max() > STIFF for angle in stiff.values()):
        # where an ankle does not bend as far as a flat foot needs, the heel is up
        stands = {name: [s.raised(stiff[name], model.timestep) for s in stands[name]] for name in stands}
        joint_q[:] = copied
        moved, _ = _plant(model, joint_q, treads, stands, knees)
    hands = [pose.limb_bodies(model, elbow)[2] for elbow in out.mapping.arms]
    body_q = pose.forward(model, joint_q, hands)
    for elbow in out.mapping.arms:
        upper, lower, hand = pose.limb_bodies(model, elbow)
        places = [out.goals[model.body_names[b]] for b in (upper, lower, hand)]
        shrug(model, joint_q, upper, places[0])
        axis = elbow_axis(model, joint_q, elbow, *places[1:])
        turn = Rotation.from_quat(body_q[:, hand, 3:])
        reach(model, joint_q, elbow, places[2], turn, axis)
        lift_out(model, joint_q, elbow, places[2], model.descendants(hand))
    return replace(out, stands=stands, moved=moved)


def _plant(
    model: Model,
    joint_q: np.ndarray,
    treads: dict[str, Tread],
    stands: dict[str, list[Stand]],
    knees: dict[str, str],
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Bring both legs of joint_q, in place, to feet that stand where they stand. Returns the root's way
    (frames, 3) [m], and by how much (frames,) [rad] each foot is turned from what it should be."""
    turns: dict[str, tuple[Rotation, np.ndarray]] = {}
    legs, stiff = [], {}
    for name, tread in treads.items():
        ankle, turn, toes = swinging(find_foot(model, name), tread, stands[name], model.timestep)
        turns[name] = turn, toes
        legs.append(Leg(knees[name], ankle, standing(stands[name], len(ankle))))
    moved, ankles = ease_knees(model, joint_q, legs)
    moved[:, 2] -= lower_root(model, joint_q, {leg.hinge: ankle for leg, ankle in zip(legs, ankles)})
    for name, ankle in zip(treads, ankles):
        foot = find_foot(model, name)
        stiff[name] = _place_foot(model, joint_q, foot, knees[name], ankle, *turns[name])
    return moved, stiff


def _place_foot(
    model: Model,
    joint_q: np.ndarray,
    foot: Foot,
    knee: str,
    place: np.ndarray,
    turn: Rotation,
    toes: np.ndarray,
) -> np.ndarray:
    """Bring a leg to its foot's path, in place; a foot that the ankle's range turns into the ground goes
    that much higher. Returns by how much (frames,) [rad] that range turns it."""
    joint_q[:, model.q_slice(foot.toe_joint)] = toes[:, None]
    keep_range(model, joint_q, foot.toe_joint)
    reach(model, joint_q, knee, place, turn)
    now = Rotation.from_quat(pose.forward(model, joint_q, [foot.body])[:, foot.body, 3:])
    lift_out(model, joint_q, knee, place, [foot.body, foot.toes])
    return np.asarray((now.inv() * turn).magnitude())


def _ground(model: Model, treads: dict[str, Tread]) -> np.ndarray:
    """Height (frames,) [m] of the ground under the recording: constant where the clip is short, else
    following what the soles come down to, of our feet on the recording's ankles."""
    heights = [
        sole_heights(find_foot(model, name), t.ankle, t.turn).min(axis=1) for name, t in treads.items()
    ]
    low = gaussian_filter1d(np.min(heights, axis=0), 0.03 / model.timestep, mode="nearest")
    rows = round(GROUND[0] / model.timestep)
    ground = minimum_filter1d(low, min(rows, len(low)), mode="nearest")
    return gaussian_filter1d(ground, GROUND[1] / model.timestep, mode="nearest")


def _toe_joint(model: Model, motion: Motion, mapping: Mapping, foot: str) -> str | None:
    """The recording's joint for a foot's toes: the mapping's, else a child of the foot's joint that is called
    one; None when there is none."""
    toes = model.body_names[find_foot(model, foot).toes]
    if toes in mapping.bodies or foot not in mapping.bodies:
        return mapping.bodies.get(toes)
    found = anatomy.parts(motion.joint_names, motion.parents)
    ankle = motion.index(mapping.bodies[foot])
    own = [joint for part, joint in found.items() if part.endswith("_toe") and motion.parents[joint] == ankle]
    return motion.joint_names[own[0]] if own else None


def _treads(
    model: Model,
    motion: Motion,
    positions: np.ndarray,
    since: Callable[[str], Rotation],
    joint_q: np.ndarray,
    goals: dict[str, np.ndarray],
    toes: dict[str, str | None],
) -> dict[str, Tread]:
    """Foot -> how it was recorded, levelled. positions: (frames, joints, 3) [m], scaled; joint_q: with copied
    rotations; toes: foot -> joint of the recording."""
    feet = {name: find_foot(model, name) for name in toes}
    body_q = pose.forward(model, joint_q, [foot.body for foot in feet.values()])
    treads = {}
    for name, foot in feet.items():
        turn = Rotation.from_quat(body_q[:, foot.body, 3:])
        ball = goals[name][:, 2] + turn.apply(foot.ball)[:, 2]
        bent = np.zeros(len(joint_q))
        toe = toes[name]
        if toe is not None:
            parent = motion.joint_names[motion.parents[motion.index(toe)]]
            ball = positions[:, motion.index(toe), 2]
            bent = pose.twist(since(parent).inv() * since(toe), model.joint_axis(foot.toe_joint))
            # single frames jump in almost every recording
            bent = low_pass(median_filter(bent, 5, mode="nearest"), 1.0 / model.timestep, TOES)
        treads[name] = Tread(goals[name], turn, ball, bent).levelled(foot, model.timestep)
    return treads


def _body_rotations(
    model: Model,
    motion: Motion,
    positions: np.ndarray,
    since: Callable[[str], Rotation],
    mapping: Mapping,
) -> dict[str, Rotation]:
    """World rotation of each mapped body of the model: turn of the recorded joint since the T-pose, times
    the match."""
    match = match_limbs(model, motion, mapping, since)
    turned = {}
    for body, joint in mapping.bodies.items():
        turned[body] = since(joint) * match.get(body, Rotation.identity())
        if body in mapping.palms:
            places = [positions[:, motion.index(j)] for j in mapping.palms[body]]
            turned[body] = _palm(model, body, places, np.radians(mapping.supinated.get(body, 0.0)))
    return turned


def _palm(model: Model, hand: str, places: list[np.ndarray], supinated: float) -> Rotation:
    """World rotation of a hand from its wrist and knuckles; places: four of (frames, 3) [m]. supinated: [rad]
    by which the palm turns to the thumb's side from there."""
    side = model.roles.hands.index(hand)
    knuckles = model.roles.knuckles[side]
    own = [model.zero_pose[model.body(name), :3] for name in (hand, *knuckles)]
    wrist, index, middle, little = places
    now = pose.frame_of(middle - wrist, index - little)
    fingers, thumb = own[2] - own[0], own[1] - own[3]
    out = np.cross(fingers, thumb) * (1.0 - 2.0 * side)
    axis = np.cross(out, thumb) / np.linalg.norm(np.cross(out, thumb))
    return now * pose.frame_of(fingers, thumb).inv() * Rotation.from_rotvec(supinated * axis)


def _fill_joints(
    model: Model, joint_q: np.ndarray, turned: dict[str, Rotation], smoothed: dict[str, float]
) -> None:
    """Joint coordinates of the bodies in `turned`, in place; hinges take the angle nearest to the copied
    rotation, all stay within their range. smoothed: body -> [Hz], low-passed after that.

    A joint's own rotation is what brings its body, now at the zero angle, to the wanted world rotation.
    """
    zero = model.zero_q
    for body, name in enumerate(model.body_names):
        if name not in turned or model.body_parent[body] < 0:
            continue
        joint = model.body_joint(body)
        q = model.q_slice(joint)
        joint_q[:, q] = zero[q]
        now = Rotation.from_quat(pose.forward(model, joint_q, [body])[:, body, 3:])
        wanted = now.inv() * turned[name]
        if model.joint_type(joint) == "ball":
            joint_q[:, q] = wanted.as_quat()
        else:
            joint_q[:, q] += pose.twist(wanted, model.joint_axis(joint))[:, None]
        if name in smoothed and model.joint_type(joint) == "ball":
            # what is far beyond a joint's range is no rotation of that joint
            high = joint_range(model.joints[model.joint(joint)])[1]
            wanted = brought_within(wanted, high, Rotation.identity(len(joint_q)))
            joint_q[:, q] = wanted.as_quat(canonical=True)
        keep_range(model, joint_q, joint)
        if name in smoothed:
            # within its range, and with w >= 0, no quaternion of a ball joint is near another's opposite
            joint_q[:, q] = low_pass(joint_q[:, q], 1.0 / model.timestep, smoothed[name])
            if model.joint_type(joint) == "ball":
                joint_q[:, q] /= np.linalg.norm(joint_q[:, q], axis=1, keepdims=True)
            keep_range(model, joint_q, joint)


def _root(
    model: Model, goals: dict[str, np.ndarray], mapping: Mapping, turned: dict[str, Rotation]
) -> np.ndarray:
    """Root poses (frames, 7): the middle of the hips is where the scaled recording has it."""
    zero = model.zero_pose
    hips = [pose.limb_bodies(model, knee)[0] for knee in mapping.legs]
    middle = np.mean([goals[model.body_names[b]] for b in hips], axis=0)
    root = model.joint_body(model.root)
    facing = turned[model.body_names[root]]
    position = middle - facing.apply(zero[hips, :3].mean(axis=0) - zero[root, :3])
    return np.concatenate([position, facing.as_quat()], axis=1)
