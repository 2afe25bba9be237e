"""From a recorded skeleton to a model: rotations of corresponding joints are copied (P1 7.1).

What is copied is how far each segment has turned from the T-pose, seen in the world, so that joints
between the named ones are composed on the way and the two skeletons' joint frames need not agree.
Where a segment has a direction (an upper arm, a thigh), the T-poses are matched by that direction;
where the next joint is a hinge, by the hinge's axis too, which the recording shows by how it bends.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from . import footing, pose
from .motion import Motion
from .reference import Reference, root_joint

STRAIGHT = np.radians(8.0)
"""A hinge that never bends more than this shows no axis."""


@dataclass(frozen=True)
class Mapping:
    """Which joint of a recording turns which body of the model."""

    bodies: dict[str, str]
    """Body of the model -> joint of the recording whose frame it follows."""
    limbs: dict[str, tuple[str, str, str]]
    """Hinge of the model -> joints of the recording at the near end, the hinge and the far end
    of the limb."""
    legs: tuple[tuple[str, str, str, str], ...]
    """(hip body, foot body, hip joint, foot joint) of each leg: they set the scale."""
    in_line: tuple[str, ...] = ()
    """Ends of limbs that continue the limb's line in the T-pose: hands, not feet."""
    smoothed: dict[str, float] = field(default_factory=dict)
    """Body -> cut-off [Hz] of a low-pass filter, for joints the recording shows with noise."""


def _both_sides(entries: dict) -> dict:
    """The left side's entries and the same for the right."""

    def right(name):
        if isinstance(name, tuple):
            return tuple(map(right, name))
        return "r_" + name[2:] if name.startswith("l_") else name.replace("Left", "Right")

    return entries | {right(k): right(v) for k, v in entries.items()}


CMU = Mapping(
    bodies={"pelvis": "Hips", "lower_back": "Spine", "torso": "Spine1", "head": "Head"}
    | _both_sides(
        {
            "l_clavicle": "LeftShoulder",
            "l_upper_arm": "LeftArm",
            "l_lower_arm": "LeftForeArm",
            "l_hand": "LeftFingerBase",
            "l_upper_leg": "LeftUpLeg",
            "l_lower_leg": "LeftLeg",
            "l_foot": "LeftFoot",
        }
    ),
    limbs=_both_sides(
        {
            "l_elbow": ("LeftArm", "LeftForeArm", "LeftHand"),
            "l_knee": ("LeftUpLeg", "LeftLeg", "LeftFoot"),
        }
    ),
    legs=(
        ("l_upper_leg", "l_foot", "LeftUpLeg", "LeftFoot"),
        ("r_upper_leg", "r_foot", "RightUpLeg", "RightFoot"),
    ),
    in_line=("l_hand", "r_hand"),
    smoothed={"l_hand": 8.0, "r_hand": 8.0},
)
"""CMU's BVH skeleton onto the player. Toes stay straight: they are the noisiest joints of these
recordings."""


def retarget(model, motion: Motion, mapping: Mapping = CMU) -> Reference:
    """The motion on the model, at the model's time step, feet on z = 0.

    Bodies the mapping does not name keep the angles of the model's start pose (fingers, the ball).
    The motion is resampled to a whole number of steps. Raises ValueError for a joint or body that
    is not there.
    """
    motion = motion.resample(1.0 / model.timestep)
    turned = _body_rotations(model, motion, mapping)
    joint_q = np.tile(np.asarray(model.start_q, dtype=float), (motion.frame_count, 1))
    root = model.q_slice(root_joint(model))
    joint_q[:, root] = _root(model, motion, mapping, turned)
    _fill_joints(model, joint_q, turned)
    footing.stand(model, joint_q, [foot for _, foot, _, _ in mapping.legs])
    return Reference(joint_q, model.timestep)


def _body_rotations(model, motion: Motion, mapping: Mapping) -> dict[str, Rotation]:
    """World rotation of each mapped body of the model: turn of the recorded joint since the
    T-pose, times the match."""
    _, frames = motion.forward()
    rest_at, rest = motion.rest()

    def since_rest(joint: str) -> Rotation:
        i = motion.index(joint)
        return Rotation.from_quat(frames[:, i]) * Rotation.from_quat(rest[i]).inv()

    match = _match_limbs(model, motion, mapping, since_rest, rest_at)
    turned = {}
    for body, joint in mapping.bodies.items():
        _body(model, body)
        turned[body] = since_rest(joint) * match.get(body, Rotation.identity())
        if body in mapping.smoothed:
            turned[body] = _smooth(turned[body], mapping.smoothed[body], motion.rate)
    return turned


def _match_limbs(model, motion, mapping, since_rest, rest_at) -> dict[str, Rotation]:
    """For the segments of each limb: what turns the model's zero pose into the recording's
    T-pose."""
    unknown = [hinge for hinge in mapping.limbs if hinge not in model.joint_names]
    if unknown:
        has = ", ".join(model.joint_names)
        raise ValueError(f"the model has no joint '{unknown[0]}' to retarget onto; it has {has}")
    match = {}
    zero = pose.forward(model, pose.zero_q(model))[0]
    for hinge, (near, middle, far) in mapping.limbs.items():
        upper, lower, end = pose.limb_bodies(model, hinge)
        own = zero[end, :3] - zero[upper, :3]
        theirs = rest_at[motion.index(far)] - rest_at[motion.index(near)]
        bends = (since_rest(near).inv() * since_rest(middle)).as_rotvec()
        axis = model.joint_axis(hinge)
        shown = _common_axis(bends)
        if shown is None:
            matched = _shortest(own, theirs)
        else:
            guess = _shortest(own, theirs).apply(axis)
            shown = shown if shown @ guess > 0.0 else -shown
            matched = pose.frame_of(theirs, shown) * pose.frame_of(own, axis).inv()
        match[model.body_names[upper]] = match[model.body_names[lower]] = matched
        if model.body_names[end] in mapping.in_line:
            match[model.body_names[end]] = _shortest(own, theirs)
    return match


def _common_axis(bends: np.ndarray) -> np.ndarray | None:
    """The axis (3,) that rotation vectors (frames, 3) share, or None when they are too small to
    tell."""
    if np.linalg.norm(bends, axis=1).max() < STRAIGHT:
        return None
    return np.linalg.eigh(bends.T @ bends)[1][:, -1]


def _shortest(start: np.ndarray, end: np.ndarray) -> Rotation:
    """The smallest rotation that turns direction `start` into `end`."""
    start, end = start / np.linalg.norm(start), end / np.linalg.norm(end)
    axis = np.cross(start, end)
    sine = np.linalg.norm(axis)
    angle = np.arctan2(sine, start @ end)
    return Rotation.from_rotvec(axis * (angle / sine) if sine > 1e-12 else np.zeros(3))


def _fill_joints(model, joint_q: np.ndarray, turned: dict[str, Rotation]) -> None:
    """Joint coordinates of the bodies in `turned`, in place; hinges take the angle nearest to the
    copied rotation.

    A joint's own rotation is what brings its body, now at the zero angle, to the wanted world
    rotation.
    """
    zero = pose.zero_q(model)
    for body, name in enumerate(model.body_names):
        if name not in turned or model.body_parent[body] < 0:
            continue
        joint = pose.body_joint(model, body)
        q = model.q_slice(joint)
        joint_q[:, q] = zero[q]
        now = Rotation.from_quat(pose.forward(model, joint_q)[:, body, 3:])
        wanted = now.inv() * turned[name]
        if model.joint_type(joint) == "ball":
            joint_q[:, q] = _within_range(model, joint, wanted).as_quat()
        else:
            joint_q[:, q] += pose.twist(wanted, model.joint_axis(joint))[:, None]
            joint_q[:, q] = np.clip(joint_q[:, q], *_range(model, joint))


def _within_range(model, joint: str, turn: Rotation) -> Rotation:
    """A ball joint's rotation, cut back along its axis to the joint's largest angle."""
    vector = turn.as_rotvec()
    angle = np.linalg.norm(vector, axis=1, keepdims=True)
    largest = 0.95 * _range(model, joint)[1]
    return Rotation.from_rotvec(vector * np.minimum(1.0, largest / np.maximum(angle, 1e-9)))


def _range(model, joint: str) -> tuple[float, float]:
    """[rad] limits of a joint, infinite where it has none."""
    link = model.joint_link[model.joint(joint)]
    if not model.tables["link_limited"][link]:
        return -np.inf, np.inf
    return float(model.tables["link_lower"][link]), float(model.tables["link_upper"][link])


def _root(model, motion: Motion, mapping: Mapping, turned) -> np.ndarray:
    """Root poses (frames, 7): the middle of the hips follows the recording's, scaled by leg
    length."""
    zero = pose.forward(model, pose.zero_q(model))[0]
    rest_at, _ = motion.rest()
    own = theirs = 0.0
    for hip, foot, hip_joint, foot_joint in mapping.legs:
        own += np.linalg.norm(zero[_body(model, hip), :3] - zero[_body(model, foot), :3])
        legs = rest_at[motion.index(hip_joint)] - rest_at[motion.index(foot_joint)]
        theirs += np.linalg.norm(legs)
    positions, _ = motion.forward()
    middle = np.mean([positions[:, motion.index(leg[2])] for leg in mapping.legs], axis=0)
    hips = np.mean([zero[_body(model, leg[0]), :3] for leg in mapping.legs], axis=0)
    root = pose.joint_body(model, root_joint(model))
    facing = turned[model.body_names[root]]
    position = (own / theirs) * middle - facing.apply(hips - zero[root, :3])
    return np.concatenate([position, facing.as_quat()], axis=1)


def _smooth(turns: Rotation, cut_off: float, rate: float) -> Rotation:
    """Low-pass filter of rotations, forward and backward so that nothing is delayed."""
    if len(turns) < 16 or cut_off >= 0.45 * rate:
        return turns
    middle = turns.mean()
    steps = (middle.inv() * turns).as_rotvec()
    filtered = sosfiltfilt(butter(2, cut_off, fs=rate, output="sos"), steps, axis=0)
    return middle * Rotation.from_rotvec(filtered)


def _body(model, name: str) -> int:
    if name not in model.body_names:
        raise ValueError(f"the model has no body '{name}'; it has {', '.join(model.body_names)}")
    return model.body(name)
