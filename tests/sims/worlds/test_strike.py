"""Impacts with restitution: what falls straight leaves straight, as high as Newton's law says."""

import numpy as np
import pytest

from tests.reference.scenes import GRAVITY, ground, record, scene
from warpdribble.sims import Simulation

H = 0.01
RESTITUTIONS = [0.0, 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95]

SHAPES = {
    "box": '<geom type="box" size="0.2 0.1 0.1" mass="1" {}/>',
    "flat box": '<geom type="box" size="0.3 0.25 0.02" mass="20" {}/>',
    "tall box": '<geom type="box" size="0.05 0.14 0.27" mass="0.4" {}/>',
    "capsule": '<geom type="capsule" size="0.05 0.3" euler="1.5707963267948966 0 0" mass="3" {}/>',
    "two balls": '<geom type="sphere" size="0.1" pos="0.3 0 0" mass="1" {}/>'
    '<geom type="sphere" size="0.1" pos="-0.3 0 0" mass="1" {}/>',
    "table": '<geom type="box" size="0.4 0.3 0.02" pos="0 0 0.2" mass="8" {}/>'
    + "".join(
        f'<geom type="capsule" size="0.02 0.18" pos="{x} {y} 0" mass="1" {{}}/>'
        for x in (-0.36, 0.36)
        for y in (-0.26, 0.26)
    ),
}


def dropped(shape, height=0.6, yaw=0.0, restitutions=RESTITUTIONS, friction=0.8):
    """A world per restitution, each with the body at rest, unturned but for `yaw`, that high."""
    look = f'friction="{friction}" user="1 0.2 1e-5"'
    xml = f'<body name="b"><freejoint/>{SHAPES[shape].replace("{}", look)}</body>'
    model = scene(ground() + xml, H)
    sim = Simulation(model, len(restitutions))
    sim.reset(joint_q=[0, 0, height, 0, 0, np.sin(yaw / 2), np.cos(yaw / 2)])
    sim.set_contact("b", "ground", restitution=np.array(restitutions))
    return sim


@pytest.mark.parametrize("yaw", [0.0, 0.7, 2.66])
@pytest.mark.parametrize("shape", list(SHAPES))
def test_falls_and_rises_straight(shape, yaw):
    """Four seconds of bounces: no turn over 0.05 degrees, no move sideways over 0.1 mm."""
    sim = dropped(shape, yaw=yaw)
    q = record(sim, 400)
    # the angle from the start's orientation: its quaternion's product with the conjugate, by its vector part
    x, y, z, w = np.moveaxis(q[..., 3:].astype(float), -1, 0)
    c, s = np.cos(yaw / 2), np.sin(yaw / 2)
    vector = np.stack([c * x - s * y, c * y + s * x, c * z - s * w], axis=-1)
    turned = 2 * np.degrees(np.arcsin(np.linalg.norm(vector, axis=-1).clip(max=1)))
    moved = 1000 * np.linalg.norm(q[..., :2], axis=-1)
    print(f"turned {turned.max():.4f} degrees, moved {moved.max():.4f} mm")
    assert turned.max() <= 0.05
    assert moved.max() <= 0.1


@pytest.mark.parametrize("shape", ["box", "capsule", "two balls"])
@pytest.mark.parametrize("height", [0.4, 0.6, 1.0, 1.37])
def test_rises_to_e_squared(shape, height):
    """The first apex is e^2 of the fall, within 2 %, and from one drop height to another alike."""
    e = np.array([0.5, 0.7, 0.9, 1.0])
    sim = dropped(shape, height, restitutions=e)
    low = {"box": 0.1, "capsule": 0.05, "two balls": 0.1}[shape]
    z = record(sim, 150)[..., 2]
    fall = height - low
    lowest = z[: int(1.3 * np.sqrt(2 * fall / GRAVITY) / H)].argmin(axis=0)
    for world, k in enumerate(lowest):
        apex = z[k:, world].max() - low
        print(f"e {e[world]}: {apex / (e[world] ** 2 * fall):.4f}")
        assert apex == pytest.approx(e[world] ** 2 * fall, rel=0.02)


def test_chain_drops_straight():
    """Two hinged halves, alike: each strikes with the other, whatever rounding says, and the hinge stays
    where it is."""
    half = (
        '<body name="{0}"><joint name="j{0}" type="hinge" axis="0 1 0" stiffness="500" damping="5"/>'
        '<geom type="box" size="0.1 0.08 0.03" pos="{1} 0 0" mass="1" friction="0.8" conaffinity="0"'
        ' user="0.6 0.2 1e-5"/></body>'
    )
    xml = (
        '<body name="b"><freejoint/><inertial pos="0 0 0" mass="0.5" diaginertia="0.001 0.001 0.001"/>'
        + half.format("l", 0.12)
        + half.format("r", -0.12)
        + "</body>"
    )
    sim = Simulation(scene(ground() + xml, H), 1)
    q = sim.joint_q[0]
    q[2] = 0.5
    sim.reset(joint_q=q)
    q = record(sim, 300)[:, 0]
    assert np.abs(q[:, 7] + q[:, 8]).max() <= 1e-3  # the one's angle is the other's, mirrored
    assert np.abs(q[:, :2]).max() <= 1e-4
    assert np.abs(2 * q[:, 3:6]).max() <= 1e-3


def test_what_does_not_strike_is_left_alone():
    """A ball that bounces leaves a box at rest beside it as it lies."""
    body = '<body name="{0}"><freejoint/><geom type="{1}" size="{2}" mass="1" user="0.9 0.2 1e-5"/></body>'
    ball, box = body.format("a", "sphere", "0.1"), body.format("b", "box", "0.1 0.1 0.1")
    sim = Simulation(scene(ground() + ball + box, H), 1)
    sim.reset(joint_q=[1, 0, 0.6, 0, 0, 0, 1, 0, 0, 0.1, 0, 0, 0, 1])
    q = record(sim, 200)[:, 0]
    assert q[:, 2].max() > 0.5 and np.ptp(q[30:, 2]) > 0.2
    np.testing.assert_allclose(q[:, 7:], [[0, 0, 0.1, 0, 0, 0, 1]] * 201, atol=1e-4)
