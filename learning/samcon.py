"""prototype"""
from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np

from .locomotion import Locomotion
from .policy import LinearPolicy


@dataclass
class Config:
    islands: int = 16
    particles: int = 64
    keep: float = 0.33
    walk: int = 160
    lag: int = 12
    sigma0: float = 0.15
    floor: float = 0.05
    ridge: float = 0.02
    open_loop: int = 2
    qd_noise: float = 0.15
    arm_noise: float = 0.0
    push: float = 0.0


class Samcon:
    def __init__(self, task: Locomotion, config: Config, seed=0):
        self.task, self.config = task, config
        self.random = np.random.default_rng(seed)
        g = task.graph
        self.policy = LinearPolicy.zero(g.count, task.actions, task.size, config.sigma0)
        self.iteration = 0
        self.starts = None  # recorded (k, q, qd)

    def begin(self):
        """Each island starts in one state, all its particles alike."""
        c, task, g = self.config, self.task, self.task.graph
        if self.starts is None:
            k = self.random.integers(g.count, size=c.islands)
            q, qd = g.start_q[k], g.start_qd[k]
        else:
            pick = self.random.integers(len(self.starts[0]), size=c.islands)
            k, q, qd = (x[pick] for x in self.starts)
        qd = task.still(qd + c.qd_noise * self.random.standard_normal(qd.shape))
        rep = lambda x: np.repeat(x, c.particles, axis=0)
        task.sim.reset(joint_q=rep(task.parked(q)), joint_qd=rep(qd))
        return rep(k)

    def walk(self):
        """E-step."""
        c, task = self.config, self.task
        n = c.islands * c.particles
        k = self.begin()
        f = task.character.sense(k)
        S, A, K, P, E = [], [], [], [], []
        island = np.repeat(np.arange(c.islands), c.particles)
        saved_k, saved_q, saved_qd = [], [], []
        lost = 0
        for t in range(c.walk):
            s = task.state(f, k)
            a = self.policy.act(s, k) + self.policy.sigma[k] * self.random.standard_normal((n, task.actions))
            f = task.advance(k, a)
            cost = task.cost(f, k)
            parents = np.arange(n)
            order = np.argsort(cost.reshape(c.islands, -1), axis=1)
            best = order[:, : max(1, int(c.keep * c.particles))] + np.arange(c.islands)[:, None] * c.particles
            dead_islands = []
            for i in range(c.islands):
                alive = best[i][np.isfinite(cost[best[i]])]
                own = np.arange(i * c.particles, (i + 1) * c.particles)
                if len(alive) == 0:
                    dead_islands.append(i)
                    continue
                parents[own] = np.resize(alive, c.particles)
                parents[alive] = alive
                others = np.setdiff1d(own, alive, assume_unique=True)
                parents[others] = np.resize(self.random.permutation(alive), len(others))
            lost += len(dead_islands)
            if len(dead_islands) == c.islands:
                break
            for i in dead_islands:
                donor = self.random.choice(np.setdiff1d(np.arange(c.islands), dead_islands))
                own = slice(i * c.particles, (i + 1) * c.particles)
                parents[own] = parents[donor * c.particles : (donor + 1) * c.particles]
            S.append(s); A.append(a); K.append(k); P.append(parents); E.append(cost)
            task.sim.copy_worlds(parents)
            f = f[parents]
            k = task.graph.follow(k[parents][:: c.particles], self.random).repeat(c.particles) if len(task.graph.successors[0]) > 1 else task.graph._table[k[parents], 0]
            if t % 5 == 4 and t > 20:
                firsts = np.arange(c.islands) * c.particles
                saved_k.append(k[firsts]); saved_q.append(task.sim.joint_q[firsts]); saved_qd.append(task.sim.joint_qd[firsts])
        if len(P) == c.walk and saved_k:
            self.starts = [np.concatenate(x) for x in (saved_k, saved_q, saved_qd)]
        return S, A, K, P, E, lost

    def weights(self, P):
        """Descendants that each sample has `lag` fragments later."""
        c = self.config
        T, n = len(P), len(P[0])
        out = []
        end = T if T == c.walk else max(1, T - c.lag)
        for t in range(end):
            line = np.arange(n)
            for u in range(min(t + c.lag, T - 1), t - 1, -1):
                line = P[u][line]
            out.append(np.bincount(line, minlength=n))
        return out

    def update(self, S, A, K, W):
        """M-step: weighted ridge regression that stays near the old policy."""
        c, p = self.config, self.policy
        S, A, K, W = (np.concatenate(x[:len(W)]) for x in (S, A, K, W))
        use = W > 0
        S, A, K, W = S[use], A[use], K[use], W[use].astype(float)
        for k in range(self.task.graph.count):
            mine = K == k
            if mine.sum() < 4:
                continue
            s, a, w = S[mine], A[mine], W[mine] / W[mine].sum()
            n_eff = 1.0 / (w**2).sum()
            ms, ma = w @ s, w @ a
            if self.iteration < c.open_loop:
                shrink = n_eff / (n_eff + 5)
                p.a_hat[k] += shrink * (ma - p.a_hat[k])
                continue
            sc, ac = s - ms, a - ma
            left = (sc * w[:, None]).T @ sc
            right = (sc * w[:, None]).T @ (ac - sc @ p.M[k].T)
            lam = c.ridge + 20.0 / n_eff
            dM = np.linalg.solve(left + lam * np.eye(len(left)), right).T
            p.M[k] += dM
            p.a_hat[k] = ma - p.M[k] @ ms
            res = ac - sc @ p.M[k].T
            var = w @ res**2
            p.sigma[k] = np.sqrt(np.maximum(0.5 * p.sigma[k] ** 2 + 0.5 * var, c.floor**2))

    def step(self):
        t0 = time.time()
        S, A, K, P, E, lost = self.walk()
        t1 = time.time()
        W = self.weights(P)
        self.update(S, A, K, W)
        self.iteration += 1
        Ef = np.concatenate(E); Ef = Ef[np.isfinite(Ef)]
        return dict(t=len(P), lost=lost, cost=Ef.mean(), sigma=self.policy.sigma.mean(), walk_s=t1 - t0, fit_s=time.time() - t1, uniq=np.mean([np.count_nonzero(w) for w in W]))


def evaluate(task, policy, cycles=20, qd_noise=0.15, starts=None, seed=0, noise=0.0):
    random = np.random.default_rng(seed)
    g, n = task.graph, task.sim.world_count
    if starts is None:
        k = random.integers(g.count, size=n); q, qd = g.start_q[k], g.start_qd[k]
    else:
        i = random.integers(len(starts[0]), size=n); k, q, qd = (x[i] for x in starts)
    qd = task.still(qd + qd_noise * random.standard_normal(qd.shape))
    task.sim.reset(joint_q=task.parked(q), joint_qd=qd)
    f = task.character.sense(k)
    alive = np.ones(n, bool); life = np.zeros(n); cost = []
    for t in range(cycles * g.count):
        a = policy.act(task.state(f, k), k)
        if noise: a = a + noise * random.standard_normal(a.shape)
        f = task.advance(k, a)
        c = task.cost(f, k)
        alive &= np.isfinite(c); life += alive
        cost.append(c[alive].mean() if alive.any() else np.nan)
        if not alive.any(): break
        k = g._table[k, 0]
    return alive.mean(), life.mean() / g.count, np.nanmean(cost)
