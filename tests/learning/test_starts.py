"""Random numbers of units that know nothing of each other, and states that are drawn with them."""

import numpy as np
import pytest

from warpdribble.learning.starts import Starts, Streams, reference_starts

KINDS = ("uniform", "normal")
SHAPES = [(), (1,), (3,), (2, 5), (0,)]


def randoms(seed, count=1):
    return [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(count)]


# --------------------------------------------------------------------------------------------- streams


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("shape", SHAPES)
def test_what_a_unit_draws_does_not_depend_on_those_beside_it(kind, shape):
    """The last of four as alone, and as one of two, draw after draw."""
    several, pair = Streams(randoms(1, 4)), Streams(randoms(1, 4)[2:])
    alone = Streams(randoms(1, 4)[3:], group=7)
    for _ in range(3):
        drawn = getattr(several, kind)(*shape)
        assert drawn.shape == (4, *shape) and drawn.dtype == float
        np.testing.assert_array_equal(getattr(alone, kind)(*shape), drawn[3:])
        np.testing.assert_array_equal(getattr(pair, kind)(*shape), drawn[2:])
        assert not drawn.size or len(np.unique(drawn)) == drawn.size


@pytest.mark.parametrize("kind", KINDS)
def test_one_stream_for_all(kind):
    one, same = Streams(randoms(2), 4), np.random.default_rng(np.random.SeedSequence(2).spawn(1)[0])
    drawn = getattr(one, kind)(3)
    expected = (same.random if kind == "uniform" else same.standard_normal)((4, 3))
    np.testing.assert_array_equal(drawn, expected)


def test_the_numbers_are_spread_as_they_should():
    """Of 40 000: a mean is known to 0.005, a variance to 0.7 %."""
    for streams in (Streams(randoms(3, 4)), Streams(randoms(3), 4)):
        uniform, normal = streams.uniform(10000), streams.normal(10000)
        assert uniform.min() >= 0.0 and uniform.max() < 1.0
        assert abs(uniform.mean() - 0.5) < 0.01 and uniform.var() == pytest.approx(1 / 12, rel=0.03)
        assert abs(normal.mean()) < 0.02 and normal.var() == pytest.approx(1.0, rel=0.03)


def test_some_units_draw_and_the_others_stay_where_they_are():
    streams, still = Streams(randoms(4, 3), group=2), Streams(randoms(4, 3), group=2)
    some = streams.only(np.array([True, False, True]))
    assert some.count == 2 and some.group == 2
    drawn = some.uniform(5)
    expected = still.uniform(5)
    np.testing.assert_array_equal(drawn, expected[[0, 2]])
    np.testing.assert_array_equal(streams.uniform(5)[1], expected[1])
    with pytest.raises(ValueError, match="cannot draw alone"):
        Streams(randoms(4), 3).only(np.array([True, False, False]))


@pytest.mark.parametrize(("streams", "units"), [(2, 3), (3, 2), (0, 2)])
def test_streams_for_another_number_of_units_are_refused(streams, units):
    with pytest.raises(ValueError, match=rf"{streams} streams for {units} units"):
        Streams(randoms(5, streams), units)


def test_worlds_have_what_their_unit_has():
    values = np.arange(6).reshape(3, 2)
    np.testing.assert_array_equal(Streams(randoms(6, 3), group=2).worlds(values), values[[0, 0, 1, 1, 2, 2]])
    np.testing.assert_array_equal(Streams(randoms(6, 3)).worlds(values), values)


# ---------------------------------------------------------------------------------------------- starts


def test_states_are_drawn_with_noise_on_velocities_only(graph):
    starts = reference_starts(graph)
    assert len(starts) == graph.count
    drawn = starts.draw(Streams(randoms(1), 3000), 0.5)
    np.testing.assert_array_equal(drawn.joint_q, graph.start_q[drawn.k])
    assert set(drawn.k) == set(range(graph.count))
    noise = drawn.joint_qd - graph.start_qd[drawn.k]
    assert noise.std() == pytest.approx(0.5, rel=0.02) and (noise.std(axis=0) > 0.4).all()
    still = starts.draw(Streams(randoms(1), 5))
    np.testing.assert_array_equal(still.joint_qd, graph.start_qd[still.k])


def test_the_worlds_of_a_unit_start_alike(graph):
    drawn = reference_starts(graph).draw(Streams(randoms(2, 6), group=3), 0.5)
    assert len(drawn) == 18
    for part in (drawn.k[:, None], drawn.joint_q, drawn.joint_qd):
        units = part.reshape(6, 3, -1)
        np.testing.assert_array_equal(units, np.broadcast_to(units[:, :1], units.shape))
    assert len(np.unique(drawn.joint_qd, axis=0)) == 6


def test_a_unit_starts_where_it_would_alone(graph):
    starts = reference_starts(graph)
    several = starts.draw(Streams(randoms(3, 4), group=2), 0.1)
    alone = starts.draw(Streams(randoms(3, 4)[1:2], group=2), 0.1)
    for name, part in vars(alone).items():
        np.testing.assert_array_equal(part, getattr(several, name)[2:4])


def test_starts_are_joined_in_their_order(graph):
    first = reference_starts(graph)
    second = Starts(first.k[:2] + 1, first.joint_q[:2] + 1.0, first.joint_qd[:2] + 2.0)
    both = Starts.joined([second, first])
    assert len(both) == graph.count + 2
    np.testing.assert_array_equal(both.k, [1, 2, *range(graph.count)])
    np.testing.assert_array_equal(both.joint_q[:2], second.joint_q)
    np.testing.assert_array_equal(both.joint_qd[2:], graph.start_qd)
