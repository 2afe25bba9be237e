"""A network policy as an ONNX model, evaluated by the onnx package, against NumPy."""

import sys
from dataclasses import fields, replace

import numpy as np
import pytest

from warpdribble.learning.policies.network import LIMIT, Network, NetworkPolicy
from warpdribble.learning.policies.onnx import onnx_model
from warpdribble.sims.errors import InputError

OBS, ACTIONS, FRAGMENTS, WIDTH = 11, 4, 5, 8


def made_up(linear):
    """A policy of random numbers, whose linear part feels so many of the state's."""
    rng = np.random.default_rng(1)
    shapes = [(OBS, WIDTH), (FRAGMENTS, WIDTH), (WIDTH, WIDTH), (WIDTH,), (WIDTH, ACTIONS), (ACTIONS,)]
    layers = [rng.normal(size=shape).astype(np.float32) for shape in shapes]
    return NetworkPolicy(
        0.1 * rng.normal(size=(FRAGMENTS, ACTIONS, linear)),
        rng.normal(size=(FRAGMENTS, ACTIONS)),
        rng.normal(size=OBS),
        rng.uniform(0.1, 2.0, OBS),
        np.array(0.04),
        Network(**dict(zip([f.name for f in fields(Network)], layers))),
    )


def evaluated(model, s, k):
    reference = pytest.importorskip("onnx.reference")
    (action,) = reference.ReferenceEvaluator(model).run(None, {"s": s, "k": k})
    return action


@pytest.mark.parametrize("linear", [0, 6, OBS])
@pytest.mark.parametrize("n", [1, 64])
def test_it_does_what_the_policy_does(linear, n):
    """States so large that some are cut off; reading it back from bytes changes nothing."""
    onnx = pytest.importorskip("onnx")
    policy, rng = made_up(linear), np.random.default_rng(2)
    s, k = rng.normal(0.0, 4.0, (n, OBS)).astype(np.float32), rng.integers(0, FRAGMENTS, n)
    model = onnx.load_from_string(onnx_model(policy).SerializeToString())
    action = evaluated(model, s, k)
    assert action.dtype == np.float32
    np.testing.assert_allclose(action, policy.act(s, k), atol=1e-5)
    if n > 1:
        assert np.any(np.abs(policy.felt(s)) == LIMIT) and np.any(np.abs(policy.felt(s)) < LIMIT)
        assert np.ptp(action, axis=0).min() > 0.1


def test_each_part_counts():
    """What another policy does is not what this one's model does, whichever part is another's."""
    pytest.importorskip("onnx")
    policy, rng = made_up(6), np.random.default_rng(2)
    s, k = rng.normal(size=(32, OBS)).astype(np.float32), rng.integers(0, FRAGMENTS, 32)
    action = evaluated(onnx_model(policy), s, k)
    for name in ("M", "a_hat", "mean", "scale", "reach"):
        other = replace(policy, **{name: 1.1 * getattr(policy, name)})
        assert np.abs(other.act(s, k) - action).max() > 1e-3, name
    for name in Network.names():
        network = replace(policy.network, **{name: 1.1 * getattr(policy.network, name)})
        assert np.abs(replace(policy, network=network).act(s, k) - action).max() > 1e-3, name


def test_without_onnx_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "onnx", None)
    with pytest.raises(InputError, match=r"pip install 'warpdribble\[onnx\]'"):
        onnx_model(made_up(6))
