"""Small MJCF scenes, and how a test looks at a simulation."""

import tempfile
import warnings
from pathlib import Path

import numpy as np

from warpdribble.sims import Model

GRAVITY = 9.81
RADIUS, MASS = 0.12, 0.6
SHELL = 2 / 3 * MASS * RADIUS**2
"""Moment of inertia of a thin shell about its centre [kg m^2]."""


def model(xml: str, name: str = "scene.xml") -> Model:
    """Model of a string."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, name)
        file.write_text(xml)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return Model.load(file)


def scene(worldbody: str, timestep=0.01, gravity="0 0 -9.81", rest: str = "") -> Model:
    return model(
        f'<mujoco><compiler angle="radian" autolimits="true"/><size nuser_geom="3"/>'
        f'<option timestep="{timestep}" gravity="{gravity}"/>'
        f"<worldbody>{worldbody}</worldbody>{rest}</mujoco>"
    )


def ground(normal="0 0 1") -> str:
    return (
        f'<geom name="ground" type="plane" size="0 0 1" zaxis="{normal}" friction="0.8" user="1 0.2 1e-5"/>'
    )


def ball(name="ball", height=1.0, restitution=0.0) -> str:
    """A thin shell."""
    return (
        f'<body name="{name}" pos="0 0 {height}"><freejoint name="{name}"/>'
        f'<inertial pos="0 0 0" mass="{MASS}" diaginertia="{SHELL} {SHELL} {SHELL}"/>'
        f'<geom name="{name}" type="sphere" size="{RADIUS}" friction="0.8"'
        f' user="{restitution} 0.2 1e-5"/></body>'
    )


def start(model: Model, count: int) -> np.ndarray:
    """(count, nq), the model's start pose."""
    return np.tile(model.start_q, (count, 1))


def record(sim, steps: int, of=lambda sim: sim.joint_q.copy()) -> np.ndarray:
    """(steps + 1, ...) of something, the present first."""
    out = [of(sim)]
    for _ in range(steps):
        sim.step()
        out.append(of(sim))
    return np.array(out)
