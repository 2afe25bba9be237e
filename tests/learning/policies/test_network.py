"""Networks: NumPy's against torch's, and torch's own against another way to write them."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from warpdribble.learning.policies.actor_critic import ActorCritic, Rows, through  # noqa: E402
from warpdribble.learning.policies.network import LIMIT, NetworkPolicy, elu  # noqa: E402

OBS, ACTIONS, FRAGMENTS = 7, 3, 5


@pytest.fixture(scope="module")
def nets():
    return ActorCritic(OBS, ACTIONS, FRAGMENTS, width=16, rate=1e-3, seed=4)


@pytest.fixture
def felt():
    rng = np.random.default_rng(1)
    return rng.normal(size=(40, OBS)).astype(np.float32), rng.integers(0, FRAGMENTS, 40)


def policy(network, base=OBS):
    rng = np.random.default_rng(2)
    return NetworkPolicy(
        M=rng.normal(size=(FRAGMENTS, ACTIONS, base)),
        a_hat=rng.normal(size=(FRAGMENTS, ACTIONS)),
        mean=rng.normal(size=OBS),
        scale=rng.uniform(0.5, 2.0, OBS),
        reach=np.array(0.05),
        network=network,
    )


def test_numpy_and_torch_agree(nets, felt):
    x, k = felt
    with torch.no_grad():
        other = through(nets.actor, torch.from_numpy(x), torch.from_numpy(k)).numpy()
    np.testing.assert_allclose(nets.network()(x, k), other, atol=1e-6)
    assert np.ptp(other) > 1e-3


def test_a_fragment_number_acts_as_a_one_hot_input(nets, felt):
    """One matrix product of the state and the one-hot number, in double precision."""
    x, k = felt
    n = nets.network()
    both = np.concatenate([x, np.eye(FRAGMENTS)[k]], axis=1) @ np.concatenate([n.W1, n.e]).astype(float)
    h = np.where(both > 0, both, np.exp(np.minimum(both, 0)) - 1)
    h = h @ n.W2 + n.b2
    h = np.where(h > 0, h, np.exp(np.minimum(h, 0)) - 1)
    np.testing.assert_allclose(n(x, k), h @ n.W3 + n.b3, atol=1e-5)


def test_elu():
    x = np.array([-50.0, -1.0, 0.0, 2.0])
    np.testing.assert_allclose(elu(x), [-1.0, np.exp(-1.0) - 1.0, 0.0, 2.0], atol=1e-12)


def test_the_way_back_from_rows_is_torchs(felt):
    _, k = felt
    k = torch.from_numpy(k)
    e = torch.randn(FRAGMENTS, 4, dtype=torch.float64, requires_grad=True)
    weight = torch.randn(len(k), 4, dtype=torch.float64)
    (Rows.apply(e, k) * weight).sum().backward()
    own, e.grad = e.grad.clone(), None
    (e[k] * weight).sum().backward()
    torch.testing.assert_close(own, e.grad)


def test_actions_are_the_linear_policys_and_what_the_network_adds(nets, felt):
    s, k = felt
    one = policy(nets.network(), base=4)
    x = np.clip((s - one.mean) / one.scale, -LIMIT, LIMIT)
    for i in range(len(s)):
        wanted = one.M[k[i]] @ s[i, :4] + one.a_hat[k[i]]
        wanted = wanted + 0.05 * nets.network()(x[i : i + 1].astype(np.float32), k[i : i + 1])[0]
        np.testing.assert_allclose(one.act(s, k)[i], wanted, atol=1e-5)


def test_an_absurd_state_is_cut_off(nets):
    one = policy(nets.network(), base=0)
    k = np.zeros(2, int)
    wild = np.array([np.full(OBS, 1e3), np.full(OBS, 1e9)])
    np.testing.assert_array_equal(*one.act(wild, k))


def test_it_is_arrays_and_again_itself(nets, felt):
    s, k = felt
    one = policy(nets.network())
    again = NetworkPolicy.of({name: np.array(v) for name, v in one.arrays.items()})
    np.testing.assert_array_equal(again.act(s, k), one.act(s, k))
    with pytest.raises(KeyError):
        NetworkPolicy.of({name: v for name, v in one.arrays.items() if name != "network.W2"})
