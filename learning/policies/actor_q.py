"""Actor and critic of the deterministic policy gradient (Lillicrap et al. 2015) as Liu and Hodgins 2018 have
them, Fig. 7 and 8, and one learning step (their Algorithm 1, lines 17 to 21).

A minibatch is so small that a graph of operations costs as much as the operations; so the way back is
written out. The critic feels the action in its second layer, so the policy gradient passes through that only.
Weights of a network lie in one array: Adam and the moving average are one pass over it each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch

Shapes = dict[str, tuple[int, ...]]
back = torch.ops.aten.leaky_relu_backward
MOMENTS = ("mean", "square", "count")


class Steps(Protocol):
    """Parameters of a learning step; see `ddpg.DdpgConfig`."""

    @property
    def gamma(self) -> float: ...

    @property
    def average(self) -> float: ...

    @property
    def critic_rate(self) -> float: ...

    @property
    def critic_slows(self) -> float: ...

    @property
    def rate_every(self) -> int: ...

    @property
    def rectified(self) -> int: ...


@dataclass
class Mini:
    """Minibatches of transitions, arrays (updates, size, ...), single precision."""

    x: np.ndarray
    """(updates, size, inputs)"""
    a: np.ndarray
    """(updates, size, actions)"""
    r: np.ndarray
    """(updates, size)"""
    after: np.ndarray
    """(updates, size, inputs) x'"""
    goes_on: np.ndarray
    """(updates, size) 0 where x' is terminal, else 1"""
    active: np.ndarray
    """(updates, size, actions) 1 where an action does anything, else 0"""
    active_after: np.ndarray


class Weights:
    """A network's weights by name, `of`, views of one array `flat`; and its gradient, `grad` and `slope`."""

    def __init__(self, shapes: Shapes):
        sizes = [int(np.prod(shape)) for shape in shapes.values()]
        self.flat, self.slope = torch.zeros(sum(sizes)), torch.zeros(sum(sizes))
        self.of, self.grad = (
            {name: part.view(shape) for (name, shape), part in zip(shapes.items(), flat.split(sizes))}
            for flat in (self.flat, self.slope)
        )


class Adam:
    """The optimiser of Kingma and Ba 2014 for one network, a single pass over its weights. torch's own class
    says in Python what to do for longer than it takes to do it."""

    def __init__(self, net: Weights, rate: float, decay: float = 0.0):
        self.net, self.rate, self.decay = net, rate, decay
        self.mean, self.square = torch.zeros_like(net.flat), torch.zeros_like(net.flat)
        self.count = torch.zeros(())

    def step(self) -> None:
        self.count += 1.0
        torch.ops.aten._fused_adam_(
            [self.net.flat], [self.net.slope], [self.mean], [self.square], [], [self.count],
            lr=self.rate, beta1=0.9, beta2=0.999, weight_decay=self.decay, eps=1e-8,
            amsgrad=False, maximize=False,
        )  # fmt: skip


class ActorQ:
    """Both networks, their targets and their optimisers. Drawn at random: uniform within 1 / sqrt(inputs) of
    each layer, the last within `last`."""

    def __init__(
        self,
        inputs: int,
        actions: int,
        actor: int,
        critic: tuple[int, int],
        slope: float,
        bound: float,
        decay: float,
        rates: tuple[float, float],
        last: float,
        seed: int,
    ):
        torch.set_num_threads(1)  # the other cores simulate; and two on busy cores wait for each other
        first, second = critic
        self.slope, self.bound = slope, bound
        policy: Shapes = {"V1": (inputs, actor), "c1": (actor,), "V2": (actor, actions), "c2": (actions,)}
        value: Shapes = {
            "W1": (inputs, first), "b1": (first,), "W2": (first, second), "Wa": (actions, second),
            "b2": (second,), "w3": (second, 1), "b3": (1,),
        }  # fmt: skip
        self.actor, self.actor_target, self.critic, self.critic_target = (
            Weights(shapes) for shapes in (policy, policy, value, value)
        )
        random = np.random.default_rng((seed, 3))
        reach = {"V1": inputs, "c1": inputs, "W1": inputs, "b1": inputs}
        reach |= {"W2": first + actions, "Wa": first + actions, "b2": first + actions}
        for net, target in ((self.actor, self.actor_target), (self.critic, self.critic_target)):
            for name, part in net.of.items():
                most = 1.0 / np.sqrt(reach[name]) if name in reach else last
                part.copy_(torch.from_numpy(random.uniform(-most, most, tuple(part.shape))))
            target.flat.copy_(net.flat)
        self.adam = {"actor": Adam(self.actor, rates[0]), "critic": Adam(self.critic, rates[1], 2.0 * decay)}
        self.steps = 0
        """learning steps so far"""
        self._q, self._counted = 0.0, 0
        self.q = 0.0
        """mean value of the last steps between two changes of the critic's rate"""

    @property
    def rate(self) -> float:
        """Learning rate of the critic."""
        return self.adam["critic"].rate

    def weights(self) -> dict[str, np.ndarray]:
        """A copy of the actor."""
        return {name: part.numpy().copy() for name, part in self.actor.of.items()}

    # ------------------------------------------------------------------------------------------ networks

    def actions(self, net: Weights, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Of states x (n, inputs): what the hidden layer adds up (n, H), what the last does before its bounds
        (n, actions), and the actions (Eq. 18, 19)."""
        z = torch.addmm(net.of["c1"], x, net.of["V1"])
        u = torch.addmm(net.of["c2"], self._leaky(z), net.of["V2"])
        inside = u.clamp(-self.bound, self.bound)
        return z, u, inside + self.slope * (u - inside)

    def value(
        self, net: Weights, x: torch.Tensor, a: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Of states x and actions a (n, actions): what both hidden layers add up, and Q (n, 1)."""
        z1 = torch.addmm(net.of["b1"], x, net.of["W1"])
        z2 = torch.addmm(net.of["b2"], self._leaky(z1), net.of["W2"]).addmm_(a, net.of["Wa"])
        return z1, z2, torch.addmm(net.of["b3"], self._leaky(z2), net.of["w3"])

    def _leaky(self, z: torch.Tensor) -> torch.Tensor:
        return torch.nn.functional.leaky_relu(z, self.slope)

    # ------------------------------------------------------------------------------------------- a step

    def learn(self, mini: Mini, c: Steps) -> None:
        """As many learning steps as there are minibatches."""
        x, a, r, after, goes_on, active, active_after = (
            torch.from_numpy(part) for part in vars(mini).values()
        )
        with torch.no_grad():
            for i in range(len(x)):
                q = self.improve_critic(
                    x[i], a[i], self.target(r[i], after[i], goes_on[i], active_after[i], c.gamma)
                )
                self.adam["critic"].step()
                self.improve_actor(x[i], active[i], self.steps < c.rectified)
                self.adam["actor"].step()
                for net, target in ((self.actor, self.actor_target), (self.critic, self.critic_target)):
                    target.flat.lerp_(net.flat, c.average)
                self._count(float(q), c)

    def target(
        self, r: torch.Tensor, after: torch.Tensor, goes_on: torch.Tensor, active: torch.Tensor, gamma: float
    ) -> torch.Tensor:
        """y (n,) of Eq. 13."""
        then = self.actions(self.actor_target, after)[2] * active
        return r + gamma * goes_on * self.value(self.critic_target, after, then)[2][:, 0]

    def improve_critic(self, x: torch.Tensor, a: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        """The gradient of Eq. 12 without its regularisation, which the optimiser adds; the mean value ()."""
        w, g = self.critic.of, self.critic.grad
        z1, z2, q = self.value(self.critic, x, a)
        h1, h2 = self._leaky(z1), self._leaky(z2)
        dq = (q - y[:, None]) * (2.0 / len(y))
        dz2 = back(dq @ w["w3"].T, z2, self.slope, False)
        dz1 = back(dz2 @ w["W2"].T, z1, self.slope, False)
        torch.mm(h2.T, dq, out=g["w3"])
        torch.mm(h1.T, dz2, out=g["W2"])
        torch.mm(a.T, dz2, out=g["Wa"])
        torch.mm(x.T, dz1, out=g["W1"])
        for name, dz in (("b3", dq), ("b2", dz2), ("b1", dz1)):
            torch.sum(dz, 0, out=g[name])
        return q.mean()

    def improve_actor(self, x: torch.Tensor, active: torch.Tensor, rectify: bool) -> None:
        """The gradient of Eq. 16, its sign turned, as optimisers descend; rectify: Eq. 20."""
        w, g, q = self.actor.of, self.actor.grad, self.critic.of
        z, u, a = self.actions(self.actor, x)
        z2 = self.value(self.critic, x, a * active)[1]
        up = back(q["w3"].T.expand(len(x), -1), z2, self.slope, False) @ q["Wa"].T
        if rectify:
            inside = a.clamp(-self.bound, self.bound)
            up = torch.where((a != inside) & (up * a > 0.0), inside - a, up)
        beyond = torch.where(u.abs() > self.bound, self.slope, 1.0)
        du = up * active * beyond * (-1.0 / len(x))
        dz = back(du @ w["V2"].T, z, self.slope, False)
        torch.mm(self._leaky(z).T, du, out=g["V2"])
        torch.mm(x.T, dz, out=g["V1"])
        torch.sum(du, 0, out=g["c2"])
        torch.sum(dz, 0, out=g["c1"])

    def _count(self, q: float, c: Steps) -> None:
        """Every so many steps the critic learns the slower, the higher its values are."""
        self.steps += 1
        self._q, self._counted = self._q + q, self._counted + 1
        if self._counted == c.rate_every:
            self.q = self._q / c.rate_every
            self.adam["critic"].rate = c.critic_rate * 10.0 ** (c.critic_slows * self.q)
            self._q, self._counted = 0.0, 0

    # -------------------------------------------------------------------------------------------- state

    def _nets(self) -> dict[str, Weights]:
        names = ("actor", "actor_target", "critic", "critic_target")
        return {name: getattr(self, name) for name in names}

    @property
    def state(self) -> dict[str, np.ndarray]:
        """Arrays by name, for `restore`."""
        arrays = {name: net.flat.numpy().copy() for name, net in self._nets().items()}
        numbers = {
            "steps": self.steps,
            "q": self.q,
            "sum": self._q,
            "counted": self._counted,
            "rate": self.rate,
        }
        arrays |= {name: np.array(number) for name, number in numbers.items()}
        for who, adam in self.adam.items():
            for name in MOMENTS:
                arrays[f"{who}.{name}"] = getattr(adam, name).numpy().copy()
        return arrays

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on from a `state`. Raises ValueError for one of other networks."""
        for name, net in self._nets().items():
            if state[name].shape != tuple(net.flat.shape):
                raise ValueError(f"{name} has the shape {state[name].shape}")
            net.flat.copy_(torch.from_numpy(state[name]))
        for who, adam in self.adam.items():
            for name in MOMENTS:
                getattr(adam, name).copy_(torch.from_numpy(state[f"{who}.{name}"]))
        self.adam["critic"].rate = float(state["rate"])
        self.steps, self._counted = int(state["steps"]), int(state["counted"])
        self.q, self._q = float(state["q"]), float(state["sum"])
