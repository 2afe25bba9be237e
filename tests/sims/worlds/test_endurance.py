"""Random targets for a long time, falls and all: nothing stops being finite, nothing sinks or is lost."""

import numpy as np
import pytest

from tests.reference.rigid import unit
from warpdribble.sims import Model, Simulation
from warpdribble.sims.worlds.simulation import BAD_CONTACT, FALL, NONFINITE

RENEWED = 5  # steps between new targets: a control fragment


def random_targets(model, rng, count):
    """Hinges uniform in their range, ball joints turned about any axis within their cone."""
    t, out = model.tables, np.tile(model.start_q, (count, 1))
    for name in model.joint_names:
        link = model.joint_link[model.joint(name)]
        place, kind = model.q_slice(name), model.joint_type(name)
        if kind == "hinge":
            low, high = t["link_lower"][link], t["link_upper"][link]
            out[:, place] = rng.uniform(low, high, (count, 1))
        elif kind == "ball":
            half = 0.5 * t["link_upper"][link] * rng.random((count, 1))
            axis = unit(rng.standard_normal((count, 3)))
            out[:, place] = np.hstack([np.sin(half) * axis, np.cos(half)])
    return out


def endure(worlds, fragments, seed, scale=1.0):
    """Deepest overlap of every fragment and slot's worst, falls, and the largest speed."""
    model = Model.load("player")
    rng = np.random.default_rng(seed)
    sim = Simulation(model, worlds)
    q = np.tile(model.start_q, (worlds, 1))
    ball = model.q_slice("ball").start
    q[:, ball : ball + 3] = rng.uniform([-0.5, -0.5, 0.2], [0.8, 0.5, 2.5], (worlds, 3))
    sim.reset(joint_q=q)
    depth, fastest = [], 0.0
    for _ in range(fragments):
        target = random_targets(model, rng, worlds)
        sim.set_targets(scale * target + (1 - scale) * model.start_q)
        sim.step(RENEWED)
        status = sim.status
        assert not (status & NONFINITE).any(), f"{(status & NONFINITE > 0).sum()} worlds not finite"
        depth.append(-sim.contacts().gap.min(axis=1))
        fastest = max(fastest, np.abs(sim.joint_qd).max())
    assert np.isfinite(sim.joint_q).all()
    return sim, np.array(depth), fastest


def report(sim, depth, fastest):
    steps = sim.world_count * depth.shape[0] * RENEWED
    deep = 1000 * np.quantile(np.maximum(depth, 0), [0.5, 0.9, 0.99, 0.999, 1])
    print(f"{steps} world-steps, {(sim.status & FALL > 0).sum()} of {sim.world_count} worlds fell,")
    print(f"{(sim.status & BAD_CONTACT > 0).sum()} had the ball on the body; fastest dof {fastest:.0f}")
    print("deepest overlap [mm]: median, 90 %, 99 %, 99.9 %, most:", np.round(deep, 2))
    return deep


def nothing_lost(sim):
    """The players are where their flailing may have taken them and not under the ground; the ball may
    have rolled away (nothing stops a rolling ball), but not flown."""
    x = sim.body_q[..., :3]
    ball = sim.model.body("ball")
    player = np.delete(x, ball, axis=1)
    assert x[..., 2].min() > -0.1 and player[..., 2].max() < 3.0 and x[:, ball, 2].max() < 20.0
    assert np.abs(player).max() < 100.0 and np.abs(x[:, ball]).max() < 1000.0


def test_endures():
    """32 000 world-steps; the long run has the statistics."""
    sim, depth, fastest = endure(64, 100, seed=1)
    report(sim, depth, fastest)
    nothing_lost(sim)


@pytest.mark.slow
@pytest.mark.parametrize("worlds", [256, 2560])
def test_endures_millions(worlds):
    """10^6 and 10^7 world-steps. Overlaps come of impacts at some m/s (10 ms at 3 m/s are 30 mm) and of
    the ball pressed between limbs: half of all states overlap by under 5 mm, 99 % by under 30 mm."""
    sim, depth, fastest = endure(worlds, 800, seed=2)
    deep = report(sim, depth, fastest)
    assert deep[0] <= 5 and deep[2] <= 30
    nothing_lost(sim)
