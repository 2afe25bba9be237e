"""The networks of PPO as torch has them: an actor and a critic of the same shape, and Adam."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch

from .batch import Batch, Climb
from .network import Network

Layers = dict[str, torch.Tensor]


class ActorCritic:
    """An actor whose last layer begins near nothing, its exploration, one at first, and a critic. rate: of
    Adam at first."""

    def __init__(self, obs: int, actions: int, fragments: int, width: int, rate: float, seed: int):
        torch.set_num_threads(1)  # the other cores simulate; and two on busy cores wait for each other
        random = np.random.default_rng((seed, 3))
        self.actor = layers(random, obs, fragments, width, actions, 0.01)
        self.critic = layers(random, obs, fragments, width, 1, 1.0)
        self.log = torch.zeros(actions, requires_grad=True)
        self._all = [*self.actor.values(), self.log, *self.critic.values()]
        self._mine = len(self.actor) + 1
        self.adam = torch.optim.Adam(self._all, rate, fused=True)

    def network(self) -> Network:
        """A copy of the actor."""
        return Network(**{name: part.detach().numpy().copy() for name, part in self.actor.items()})

    def log_sigma(self) -> np.ndarray:
        return self.log.detach().numpy().copy()

    @property
    def state(self) -> dict[str, np.ndarray]:
        """Arrays by name, for `restore`."""
        arrays = {"log": self.log_sigma(), "rate": np.array(self.rate)}
        for who, net in (("actor", self.actor), ("critic", self.critic)):
            arrays |= {f"{who}.{name}": part.detach().numpy().copy() for name, part in net.items()}
        for i, part in enumerate(self._all):
            for name, moment in self.adam.state[part].items():
                arrays[f"adam.{i}.{name}"] = moment.numpy().copy()
        return arrays

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on from a `state`. Raises ValueError for one of other networks."""
        named = {"log": self.log}
        for who, net in (("actor", self.actor), ("critic", self.critic)):
            named |= {f"{who}.{name}": part for name, part in net.items()}
        with torch.no_grad():
            for name, part in named.items():
                if state[name].shape != tuple(part.shape):
                    raise ValueError(f"{name} has the shape {state[name].shape}")
                part.copy_(torch.from_numpy(state[name]))
        for i, part in enumerate(self._all):
            moments = {n.split(".")[2]: v for n, v in state.items() if n.startswith(f"adam.{i}.")}
            if moments:
                self.adam.state[part] = {n: torch.from_numpy(v.copy()) for n, v in moments.items()}
        self.adam.param_groups[0]["lr"] = float(state["rate"])

    @property
    def rate(self) -> float:
        return float(self.adam.param_groups[0]["lr"])

    def value(self, x: np.ndarray, k: np.ndarray) -> np.ndarray:
        """(...) of states x (..., obs) in fragments k (...)."""
        with torch.no_grad():
            v = through(self.critic, torch.from_numpy(x), torch.from_numpy(k))
        return v.numpy()[..., 0]

    def learn(
        self,
        batch: Batch,
        advantage: np.ndarray,
        target: np.ndarray,
        active: np.ndarray,
        c: Climb,
        random: np.random.Generator,
    ) -> None:
        """Climb the clipped objective; advantage, target of the critic: (steps, worlds); active (fragments,
        actions) bool: the actions that do anything."""
        n = advantage.size
        x, k = (torch.from_numpy(a[:-1].reshape(n, *a.shape[2:])) for a in (batch.x, batch.k))
        noise, mean = (torch.from_numpy(a.reshape(n, -1)) for a in (batch.noise, batch.mean))
        old = torch.from_numpy(batch.log_sigma.astype(np.float32))
        action = mean + torch.exp(old) * noise
        counts = torch.from_numpy(active.astype(np.float32))[k]
        before = -((0.5 * noise**2 + old) * counts).sum(1)
        better, wanted = (torch.from_numpy(a.reshape(n).astype(np.float32)) for a in (advantage, target))
        apart = []
        for _ in range(c.epochs):
            for rows in torch.from_numpy(random.permutation(n)).split(c.minibatch):
                mu = through(self.actor, x[rows], k[rows])
                z = (action[rows] - mu) * torch.exp(-self.log)
                now = -((0.5 * z**2 + self.log) * counts[rows]).sum(1)
                ratio, gain = torch.exp(now - before[rows]), better[rows]
                climb = torch.minimum(ratio * gain, ratio.clamp(1 - c.clip, 1 + c.clip) * gain).mean()
                miss = (through(self.critic, x[rows], k[rows])[:, 0] - wanted[rows]).square().mean()
                self.adam.zero_grad()
                (0.5 * miss - climb).backward()
                torch.nn.utils.clip_grad_norm_(self._all[: self._mine], 1.0)
                torch.nn.utils.clip_grad_norm_(self._all[self._mine :], 1.0)
                self.adam.step()
                with torch.no_grad():
                    apart.append(float((ratio - 1.0 - torch.log(ratio)).mean()))
        self.apart = float(np.mean(apart[len(apart) // 2 :]))
        rate = self.rate * (1.15 if self.apart < c.divergence else 0.87)
        self.adam.param_groups[0]["lr"] = float(np.clip(rate, 1e-4, 2e-3))


def layers(
    random: np.random.Generator, obs: int, fragments: int, width: int, out: int, last: float
) -> Layers:
    """Weights drawn as for layers that keep a variance; those of the last are `last` times as large."""

    def drawn(n: int, m: int, size: float = 1.0) -> np.ndarray:
        return size / np.sqrt(n) * random.standard_normal((n, m))

    parts = {
        "W1": drawn(obs, width),
        "e": 0.3 * random.standard_normal((fragments, width)),
        "W2": drawn(width, width),
        "b2": np.zeros(width),
        "W3": drawn(width, out, last),
        "b3": np.zeros(out),
    }
    return {name: torch.tensor(part, dtype=torch.float32, requires_grad=True) for name, part in parts.items()}


class Rows(torch.autograd.Function):
    """e[k]; torch's own way back from an index takes longer than the rest of the network."""

    @staticmethod
    def forward(ctx: Any, e: torch.Tensor, k: torch.Tensor) -> torch.Tensor:
        ctx.save_for_backward(k)
        ctx.count = len(e)
        return e[k]

    @staticmethod
    def backward(ctx: Any, grad: torch.Tensor) -> tuple[torch.Tensor, None]:
        (k,) = ctx.saved_tensors
        return grad.new_zeros(ctx.count, grad.shape[-1]).index_add_(0, k, grad), None


def through(net: Layers, x: torch.Tensor, k: torch.Tensor) -> torch.Tensor:
    """As `Network`."""
    h = torch.nn.functional.elu(x @ net["W1"] + Rows.apply(net["e"], k))
    h = torch.nn.functional.elu(h @ net["W2"] + net["b2"])
    return h @ net["W3"] + net["b3"]
