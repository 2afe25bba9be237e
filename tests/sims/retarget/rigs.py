"""One motion, other skeletons: joints' own axes, order and scale changed, the places of all joints kept."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from warpdribble.sims.model import pose
from warpdribble.sims.recording.motion import Motion

SIDES = (("Left", 1.0), ("Right", -1.0))


def redrawn(motion, turns):
    """The motion with each joint's axes turned: turns, joints of Rotation in the joint's own frame; its rest
    pose is where all angles are zero then."""
    frames = [
        Rotation.from_quat(world) * turn for world, turn in zip(motion.forward()[1].swapaxes(0, 1), turns)
    ]
    local, offsets = [frames[0]], motion.offsets.copy()
    for joint, above in enumerate(motion.parents[1:], start=1):
        local.append(frames[above].inv() * frames[joint])
        offsets[joint] = turns[above].inv().apply(motion.offsets[joint])
    return replace(
        motion,
        rotations=np.stack([turn.as_quat() for turn in local], axis=1),
        offsets=offsets,
        rest_rotations=np.tile([0.0, 0.0, 0.0, 1.0], (len(turns), 1)),
    )


def zero_at(motion, **bent):
    """A motion with a T-pose, redrawn with zero angles at another pose. bent: joint -> rotation vector [deg]
    of all that hangs from it, in the world."""
    world = []
    for name, above in zip(motion.joint_names, motion.parents):
        turn = Rotation.from_rotvec(bent.get(name, np.zeros(3)), degrees=True)
        world.append(turn * world[above] if above >= 0 else turn)
    return redrawn(motion, [turn.inv() for turn in world])


def at_its_rest(motion):
    """The motion redrawn so that its rest pose is where all angles are zero."""
    return redrawn(motion, list(Rotation.from_quat(motion.rest()[1]).inv()))


def in_a_line(motion, right=1.0, twist=None, by=None):
    """A motion with a T-pose, redrawn so that every bone lies along X of its joint, the right side's along
    `right` times X. twist: a generator of turns about the bones; by: [deg] those between which it chooses."""
    turns = []
    for joint, above in enumerate(motion.parents):
        below = np.flatnonzero(motion.parents == joint)
        far = [k for k in below if np.linalg.norm(motion.offsets[k]) > 1e-6]
        if above < 0 or not far:
            turns.append(turns[above] if above >= 0 else Rotation.identity())
            continue
        bone = motion.offsets[far[0]]
        x = np.array([right if motion.joint_names[joint].startswith("Right") else 1.0, 0.0, 0.0])
        side = (
            np.array([0.0, 1.0, 0.0])
            if abs(bone[1]) < 0.7 * np.linalg.norm(bone)
            else np.array([0.0, 0.0, 1.0])
        )
        about = 0.0 if twist is None else twist.choice(by) if by is not None else twist.uniform(0.0, 360.0)
        drawn = pose.frame_of(bone, side) * pose.frame_of(x, np.array([0.0, 1.0, 0.0])).inv()
        turns.append(drawn * Rotation.from_rotvec(about * x, degrees=True))
    return redrawn(motion, turns)


def reordered(motion, seed):
    """The joints in another order, parents before children."""
    rng, order = np.random.default_rng(seed), [0]
    while len(order) < len(motion.parents):
        ready = [j for j, p in enumerate(motion.parents) if p in order and j not in order]
        order.append(int(rng.choice(ready)))
    return _taken(motion, order)


def _taken(motion, order):
    return replace(
        motion,
        joint_names=tuple(motion.joint_names[j] for j in order),
        parents=np.array([order.index(p) if p >= 0 else -1 for p in motion.parents[order]]),
        offsets=motion.offsets[order],
        rotations=motion.rotations[:, order],
        rest_rotations=motion.rest_rotations[order],
    )


def scaled(motion, by):
    return replace(motion, offsets=by * motion.offsets, root_position=by * motion.root_position)


def with_more(motion, bones):
    """The motion with unmoved joints more: bones, name -> (parent, offset [m])."""
    names, parents, offsets = list(motion.joint_names), list(motion.parents), list(motion.offsets)
    for name, (parent, offset) in bones.items():
        parents.append(names.index(parent))
        names.append(name)
        offsets.append(np.array(offset))
    more = np.tile([0.0, 0.0, 0.0, 1.0], (len(bones), 1))
    return replace(
        motion,
        joint_names=tuple(names),
        parents=np.array(parents),
        offsets=np.array(offsets),
        rotations=np.concatenate([motion.rotations, np.tile(more, (motion.frame_count, 1, 1))], axis=1),
        rest_rotations=np.concatenate([motion.rest_rotations, more]),
    )


def without(motion, words):
    """The motion without the joints at ends whose names hold one of `words`."""
    order = [j for j, name in enumerate(motion.joint_names) if not any(word in name for word in words)]
    return _taken(motion, order)


def split(motion, joint):
    """The motion with one joint more in the middle of the bone that leads to `joint`: a roll bone."""
    number, count = motion.joint_names.index(joint), len(motion.parents)
    half = motion.offsets[number] / 2.0
    more = with_more(motion, {f"{joint}Roll": (motion.joint_names[motion.parents[number]], half)})
    parents, offsets = more.parents.copy(), more.offsets.copy()
    parents[number], offsets[number] = count, half
    order = [*range(number), count, *range(number, count)]
    names = tuple(more.joint_names[j] for j in order)
    parents = np.array([order.index(p) if p >= 0 else -1 for p in parents[order]])
    turns, rest = more.rotations[:, order], more.rest_rotations[order]
    return Motion(names, parents, offsets[order], turns, motion.root_position, motion.rate, rest)


def on_a_carrier(motion):
    """The motion below a root that stays where it is, as MotionBuilder's Reference does."""
    still = np.tile([0.0, 0.0, 0.0, 1.0], (motion.frame_count + 1, 1, 1))
    return Motion(
        joint_names=("Reference", *motion.joint_names),
        parents=np.array([-1, *(motion.parents + 1)]),
        offsets=np.array([np.zeros(3), motion.root_position[0], *motion.offsets[1:]]),
        rotations=np.concatenate([still[1:], motion.rotations], axis=1),
        root_position=np.zeros((motion.frame_count, 3)),
        rate=motion.rate,
        rest_rotations=np.concatenate([still[0], motion.rest_rotations]),
    )


def fingers():
    """Three fingers a hand, for `with_more`."""
    bones = {}
    for side, sign in SIDES:
        wrist = f"{side}FingerBase"
        for finger, x in (("Index", 0.03), ("Middle", 0.01), ("Pinky", -0.03)):
            bones[f"{side}Hand{finger}1"] = (wrist, [x, 0.09 * sign, 0.0])
            for i in (2, 3):
                bones[f"{side}Hand{finger}{i}"] = (f"{side}Hand{finger}{i - 1}", [0.0, 0.03 * sign, 0.0])
    return bones
