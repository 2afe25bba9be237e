import numpy as np
import pytest

from warpdribble.sims.ball.chain import Anchor, Chain, Hold, Links
from warpdribble.sims.ball.hands import Hands
from warpdribble.sims.ball.possession import Flight

STEP, RADIUS = 0.01, 0.12


@pytest.fixture
def hands():
    """Two that wander."""
    rng, times = np.random.default_rng(3), np.arange(200)[:, None, None] * STEP
    size, when = rng.uniform(0.05, 0.2, (1, 2, 3)), rng.uniform(0.0, 6.0, (1, 2, 3))
    centre = np.array([0.0, 0.0, 0.8]) + size * np.sin(7.0 * times + when)
    normal = rng.normal(size=(200, 2, 3))
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    velocity = 7.0 * size * np.cos(7.0 * times + when)
    return Hands(centre, velocity, normal, np.full((200, 2), 1.4), np.zeros((200, 3)), RADIUS, STEP)


def links(hands, onward):
    """A throw from both hands to one, a hold, a flight to the other, a hold, a flight to both; the second
    hold leads to the first flight's next time where `onward` says where that is."""
    flights = [Flight(20, 60, 1, 1), Flight(90, 130, 1, 0)]
    holds = [
        Hold.of(hands, 1, (60, 90), 0, 1),
        Hold.of(hands, 0, (130, 160), 1, 0 if onward else None, bool(onward)),
        Hold.of(hands, 1, (5, 20), None, 0),
    ]
    anchors = [Anchor(0, False, hands.centre[19, 1]), Anchor(1, True, hands.centre[130, 0])]
    return Links(flights, holds[: 2 if onward else 3], anchors, *([onward] if onward else []))


@pytest.mark.parametrize("onward", [None, (np.diag([-1.0, -1.0, 1.0]), np.array([0.3, 0.1, 0.0]))])
def test_slopes_are_those_of_what_is_least(hands, onward):
    """Against central differences."""
    chain, rng = Chain(hands, links(hands, onward)), np.random.default_rng(0)
    x = chain.start + 0.01 * rng.normal(size=chain.start.shape)
    near = 1e-5
    by_steps = [(chain.off(x + e) - chain.off(x - e)) / (2.0 * near) for e in near * np.eye(len(x))]
    slopes = chain.slopes(x)
    np.testing.assert_allclose(slopes, np.transpose(by_steps), atol=2e-5 * np.abs(slopes).max())


@pytest.mark.parametrize("onward", [None, (np.eye(3), np.zeros(3))])
def test_flights_and_holds_meet(hands, onward):
    flown, carried = Chain(hands, links(hands, onward)).solve()
    for one in carried:
        comes, leaves = one.hold.comes, one.hold.leaves
        begins = one.hold.begins if comes is None else flown[comes].arrival
        np.testing.assert_allclose([one.path[0], one.velocity[0]], begins, atol=1e-9)
        if leaves is not None:
            np.testing.assert_allclose(one.path[-1], flown[leaves].place, atol=1e-3)
            np.testing.assert_allclose(one.velocity[-1], flown[leaves].velocity, atol=1e-2)
    for way in flown:
        np.testing.assert_allclose(way.path[-1], way.arrival[0], atol=1e-9)


def test_a_hold_moves_as_its_force_says(hands):
    """Stepped in rows: what its knots are not hit by is between them."""
    (_, carried) = Chain(hands, links(hands, None)).solve()
    for one in carried:
        faster = 9.81 * (one.force - [0.0, 0.0, 1.0])
        np.testing.assert_allclose(
            np.diff(one.velocity, axis=0), STEP * 0.5 * (faster[1:] + faster[:-1]), atol=1e-9
        )
        np.testing.assert_allclose(
            np.diff(one.path, axis=0), STEP * 0.5 * (one.velocity[1:] + one.velocity[:-1]), atol=1e-9
        )
