"""`Watch`: what is folded inside one launch, against the same steps made one at a time and looked at in
between."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.reference.scenes import RADIUS
from tests.sims.worlds.float64 import spot
from warpdribble.sims import Simulation
from warpdribble.sims.model import pose
from warpdribble.sims.worlds import Course, Place, Watch
from warpdribble.sims.worlds.simulation import BAD_CONTACT, FALL, NONFINITE
from warpdribble.sims.worlds.watch import (
    NOTHING,
    Folded,
    first,
    gap,
    height_of,
    last,
    least,
    most,
    total,
    trouble,
)

WORLDS, ROWS, COUNT = 19, 12, 7
HERE = Place("r_lower_arm", (0.1, -0.2, 0.3))
SEEN = {
    "touch": gap("r_palm", "ball", RADIUS),
    "reach": gap(HERE, "l_foot"),
    "apart": gap("l_palm", "ball", 0.75),
    "top": height_of("ball"),
    "over": height_of("ball", 1.0),
    "here": height_of(HERE),
    "bad": trouble(),
}
FOLDS = {"least": least, "most": most, "total": total, "last": last, "first": first}
EACH = [(name, fold) for name in SEEN for fold in FOLDS]


def terms(weights=None):
    """Every fold of every quantity; weights: (rows, terms)."""
    made = {}
    for k, (name, fold) in enumerate(EACH):
        made[f"{fold} {name}"] = FOLDS[fold](SEEN[name], None if weights is None else weights[:, k])
    return made


def thrown(model, lanes=None):
    """Players in their start pose, balls flying about: some onto a head, some players on the ground or
    broken."""
    random = np.random.default_rng(0)
    sim = Simulation(model, WORLDS, lanes=lanes)
    q, qd = np.tile(model.start_q, (WORLDS, 1)), np.zeros((WORLDS, model.nv))
    root, ball, fly = (
        model.q_slice("root").start,
        model.q_slice("ball").start,
        model.dof_slice("ball").start,
    )
    q[:, ball : ball + 3] = random.uniform([0.4, -0.5, 0.85], [0.6, -0.2, 1.15], (WORLDS, 3))
    qd[:, fly : fly + 3] = random.uniform([-2, -2, -3], [2, 2, 3], (WORLDS, 3))
    q[3:6, ball : ball + 3], qd[3:6, fly : fly + 3] = [0.0, 0.0, 1.99], [0.0, 0.0, -2.0]
    q[4, ball + 2], q[5, ball + 2] = 2.04, 2.07
    q[7, root : root + 7] = [0, 0, 0.13, 0, np.sqrt(0.5), 0, np.sqrt(0.5)]
    q[7, ball] = -2.0
    sim.reset(joint_q=q, joint_qd=qd)
    return sim


def table(model):
    random = np.random.default_rng(1)
    targets = np.tile(model.start_q, (ROWS, 1))
    hinges = [joint.q.start for joint in model.joints if joint.kind == "hinge"]
    targets[:, hinges] += 0.2 * random.standard_normal((ROWS, len(hinges)))
    return targets


def looked_at(sim, joint_q, status):
    """(worlds, n) of `SEEN`, in float64 from joint coordinates."""
    model, body_q = sim.model, pose.forward(sim.model, joint_q)
    out = []
    for seen in SEEN.values():
        if seen.kind == "BAD":
            out.append((status & (BAD_CONTACT | FALL | NONFINITE) > 0).astype(float))
        elif seen.kind == "HEIGHT":
            out.append(spot(model, body_q, seen.places[0])[:, 2] - seen.less)
        else:
            a, b = (spot(model, body_q, place) for place in seen.places)
            out.append(np.linalg.norm(b - a, axis=1) - seen.less)
    return np.stack(out, axis=1)


def folded(fold, values, weights):
    """One number of a world's (steps,)."""
    counts = weights > 0
    steps = np.flatnonzero(counts)
    if fold == "least":
        return values[counts].min(initial=NOTHING)
    if fold == "most":
        return values[counts].max(initial=-NOTHING)
    if fold == "total":
        return weights @ values
    if fold == "last":
        return values[steps[-1]] if len(steps) else 0.0
    above = np.flatnonzero(counts & (values > 0))
    return above[0] if len(above) else -1


def folded_by_hand(values, weights, rows):
    """(worlds, terms) of values (steps, worlds, seen), weights by row (rows, terms)."""
    out = np.zeros((values.shape[1], len(EACH)))
    for k, (name, fold) in enumerate(EACH):
        for w in range(len(out)):
            own = weights[rows[w] : rows[w] + len(values), k]
            out[w, k] = folded(fold, values[:, w, list(SEEN).index(name)], own)
    return out


@pytest.fixture(scope="module", params=[1, 16])
def scene(request, player):
    """A simulation, where it starts, its course, and a twin to be stepped by hand."""
    sim, twin = (thrown(player, request.param) for _ in range(2))
    start = sim.state()
    return sim, twin, start, Course(sim, table(player)), Course(twin, table(player))


def by_hand(twin, course, start, rows, count):
    """The values (steps, worlds, seen) of steps made one at a time."""
    twin.place(start)
    out = []
    for k in range(count):
        course.step(1, rows + k)
        out.append(looked_at(twin, twin.joint_q, twin.status))
    return np.array(out)


ROUND = settings(max_examples=15, deadline=None, derandomize=True)


@ROUND
@given(
    seed=st.integers(0, 2**32 - 1), count=st.integers(1, COUNT), share=st.sampled_from([1.0, 0.5, 0.15, 0.0])
)
def test_every_fold_of_every_quantity(scene, seed, count, share):
    """Weights by row, of which a share is not zero; each world on rows of its own. Places are float32 of a
    metre or two; where a number changes its sign is exact."""
    sim, twin, start, course, other = scene
    random = np.random.default_rng(seed)
    rows = random.integers(ROWS - count + 1, size=WORLDS)
    weights = random.uniform(0.2, 2.0, (ROWS, len(EACH))) * (random.random((ROWS, len(EACH))) < share)
    watch = Watch(sim, terms(weights), ROWS)
    sim.place(start)
    course.step(count, rows, watch)
    values = by_hand(twin, other, start, rows, count)
    assert np.abs(values[..., :-1]).min() > 1e-6  # no sign that rounding decides
    expected = folded_by_hand(values, weights, rows)
    np.testing.assert_allclose(watch.read(), expected, atol=4e-6, rtol=1e-6)
    whole = [k for k, (_, fold) in enumerate(EACH) if fold == "first"]
    np.testing.assert_array_equal(watch.read()[:, whole], expected[:, whole])
    np.testing.assert_array_equal(sim.joint_q, twin.joint_q)


def test_what_the_scene_shows(scene):
    """Else a fold could be right by chance: quantities change their sign on the way, troubles begin late."""
    _, twin, start, _, course = scene
    values = by_hand(twin, course, start, np.arange(WORLDS) % (ROWS - COUNT), COUNT)
    for name in ("apart", "over"):
        sign = np.sign(values[..., list(SEEN).index(name)])
        for way in (-1, 1):
            assert ((sign[0] == way) & (sign[-1] == -way)).any(), name
    bad = values[..., -1]
    begins = set(np.argmax(bad, axis=0)[bad.any(axis=0)].tolist())
    assert bad.any(axis=0).sum() >= 4 and len(begins) >= 3


@pytest.mark.parametrize("lanes", [1, 16])
def test_the_step_of_the_first_bad_contact(player, lanes):
    """The balls that fall on heads, by when they do: after which step the status first shows it."""
    sim, twin = (thrown(player, lanes) for _ in range(2))
    watch = Watch(sim, {"bad": first(trouble()), "late": first(trouble(), np.arange(ROWS) >= 4)}, ROWS)
    Course(sim, table(player)).step(ROWS, 0, watch)
    bad = np.full((ROWS, WORLDS), False)
    course = Course(twin, table(player))
    for k in range(ROWS):
        course.step(1, k)
        bad[k] = twin.status & (BAD_CONTACT | FALL) > 0
    when = np.where(bad.any(axis=0), bad.argmax(axis=0), -1)
    np.testing.assert_array_equal(watch["bad"], when)
    np.testing.assert_array_equal(watch["late"], np.where(bad.any(axis=0), np.maximum(when, 4), -1))
    assert len(np.unique(when)) > 3 and (when == -1).sum() > 10
    assert (sim.status[3:6] == BAD_CONTACT).all() and sim.status[7] == FALL


def test_a_broken_world_is_trouble(player):
    """From the first step on, and its neighbours are seen as if it were not there."""
    well, ill = thrown(player), thrown(player)
    ill._write("q", np.array([11]), np.array([np.nan]), column=player.q_slice("r_elbow").start)
    seen = []
    for sim in (well, ill):
        watch = Watch(sim, terms(), ROWS)
        Course(sim, table(player)).step(COUNT, 0, watch)
        seen.append(watch.read())
    others = np.arange(WORLDS) != 11
    np.testing.assert_array_equal(seen[0][others], seen[1][others])
    assert seen[0][11, EACH.index(("bad", "first"))] == -1
    assert seen[1][11, EACH.index(("bad", "first"))] == 0


@pytest.mark.parametrize("weights", [None, np.zeros((ROWS, len(EACH)))], ids=["no steps", "no weights"])
def test_nothing_seen(scene, weights):
    """Of no step at all, and of none that counts."""
    sim, _, start, course, _ = scene
    watch = Watch(sim, terms(weights), ROWS)
    sim.place(start)
    course.step(0 if weights is None else COUNT, 0, watch)
    nothing = {"least": NOTHING, "most": -NOTHING, "total": 0.0, "last": 0.0, "first": -1.0}
    np.testing.assert_array_equal(watch.read(), np.tile([nothing[fold] for _, fold in EACH], (WORLDS, 1)))


def test_without_weights_every_step_counts(scene):
    sim, _, start, course, _ = scene
    rows, seen = np.arange(WORLDS) % (ROWS - COUNT), []
    for weights in (None, np.ones((ROWS, len(EACH)))):
        watch = Watch(sim, terms(weights), ROWS)
        sim.place(start)
        course.step(COUNT, rows, watch)
        seen.append(watch.read())
    np.testing.assert_array_equal(*seen)


def test_each_stretch_begins_anew(scene):
    """What was seen before the last call of `step` is forgotten; what was read stays as it was."""
    sim, twin, start, course, other = scene
    watch = Watch(sim, terms(), ROWS)
    sim.place(start)
    course.step(3, 0, watch)
    early = watch.read()
    kept = early.copy()
    course.step(4, 3, watch)
    np.testing.assert_array_equal(early, kept)
    values = by_hand(twin, other, start, np.zeros(WORLDS, int), 7)[3:]
    weights = np.ones((ROWS, len(EACH)))
    expected = folded_by_hand(values, weights, np.full(WORLDS, 3))
    np.testing.assert_allclose(watch.read(), expected, atol=4e-6, rtol=1e-6)


@pytest.mark.parametrize("lanes", [1, 16])
def test_to_watch_changes_nothing(player, lanes):
    """All that a step hands to the next, and what the contacts show, to the bit."""
    sims = [thrown(player, lanes) for _ in range(3)]
    for k, sim in enumerate(sims):
        course, watch = Course(sim, table(player), ("l_elbow",), ("torso",)), Watch(sim, terms(), ROWS)
        course.offset[:], course.push[:] = 0.1, 5.0
        for row in (0, 5, 2):
            course.step(COUNT, row, watch if k == 0 or (k == 1 and row == 5) else None)
    states = [sim.state() for sim in sims]
    for other in (1, 2):
        for name in states[0].names:
            np.testing.assert_array_equal(states[0][name], states[other][name], err_msg=name)
        for part in ("gap", "point", "normal", "impulse"):
            a, b = (getattr(sim.contacts(), part) for sim in (sims[0], sims[other]))
            np.testing.assert_array_equal(a, b, err_msg=part)
        np.testing.assert_array_equal(sims[0].contact_residual(), sims[other].contact_residual())


def test_several_watches_of_one_course(scene):
    """Each keeps its own; the course goes from one to another and back."""
    sim, _, start, course, _ = scene
    low = Watch(sim, {"low": least(height_of("ball"))}, ROWS)
    high = Watch(sim, {"high": most(height_of("ball")), "steps": total(trouble())}, ROWS)
    sim.place(start)
    course.step(3, 0, low)
    before = low["low"]
    course.step(3, 0, high)
    np.testing.assert_array_equal(low["low"], before)
    assert high.read().shape == (WORLDS, 2) and high.names == ["high", "steps"]
    np.testing.assert_array_equal(high["high"], high.read()[:, 0])
    sim.place(start)
    course.step(3, 0, low)
    np.testing.assert_array_equal(low["low"], before)


def test_refused(player):
    sim = Simulation(player, 2)
    course = Course(sim, table(player))
    good = np.ones(ROWS)
    for wrong in (good[1:], np.ones((ROWS, 1)), -good, good * np.nan, good * np.inf, 1.0):
        with pytest.raises(
            ValueError, match=f"weights of 'top' must be {ROWS} numbers from 0, one for each row"
        ):
            Watch(sim, {"top": last(height_of("ball"), wrong)}, ROWS)
    for seen in (height_of("tail"), gap("ball", "tail"), gap("tail", "ball")):
        with pytest.raises(ValueError, match="no body and no site named 'tail'"):
            Watch(sim, {"there": Folded("LEAST", seen)}, ROWS)
    for rows in (ROWS - 1, ROWS + 1):  # weights would be read beyond their end
        watch = Watch(sim, {"top": last(height_of("ball"))}, rows)
        before = sim.joint_q
        with pytest.raises(ValueError, match=f"the watch is for a table of {rows} rows, not of {ROWS}"):
            course.step(1, 0, watch)
        np.testing.assert_array_equal(sim.joint_q, before)
