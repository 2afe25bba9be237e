"""`Simulation`: many worlds of one model that step together."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..model import Model
from .batch import Batch
from .state import Layout, State
from .tensors import Tensors, as_array

SWEEPS = 6
"""Usual sweeps of the contact solver a step; docs/physics.md shows the residual that this leaves."""

MAX_SPEED = 100.0
"""No joint turns faster [rad/s]. Explicit velocity-product forces would tear a limb apart beyond 1 / h."""

NONFINITE = 1
"""Bit of `Simulation.status`: the state is not finite."""
FALL = 2
"""Bit of `Simulation.status`: a part of the player other than its feet touched the ground."""
BAD_CONTACT = 4
"""Bit of `Simulation.status`: the ball touched the player elsewhere than on a hand."""
OVERSPEED = 8
"""Bit of `Simulation.status`: a joint reached `max_speed`."""
FAR = 16
"""Bit of `Simulation.status`: a free joint was too far from the origin for slow motion."""

PORTS = {"joint_q": "q", "joint_qd": "qd", "joint_target_q": "target", "joint_f": "joint_f"}
"""What a port can be opened to, and the array behind it."""


@dataclass
class Contacts:
    """Slots in which two shapes may touch, for all worlds."""

    shapes: list[tuple[str, str]]
    """(slots) names; impulses push the second along the normal"""
    gap: np.ndarray
    """(world_count, slots) [m], negative: overlap; 1000 for the second slot of capsules that need one"""
    point: np.ndarray
    """(world_count, slots, 3) half way between the surfaces [m]"""
    normal: np.ndarray
    """(world_count, slots, 3) from the first shape to the second"""
    impulse: np.ndarray
    """(world_count, slots, 3) of the last step, along the normal and two tangents [N s]"""


class Simulation(Batch):
    """`world_count` worlds of a model.

    A CPU steps `lanes` worlds in one pass of its vector unit and shares them among `threads`; on
    CUDA every world has a thread. Neither choice changes a result beyond rounding, and `threads` not
    at all.

    Arrays are `(world_count, n)` NumPy arrays, float32.
    """

    def __init__(
        self,
        model: Model,
        world_count: int = 1,
        device: str = "cpu",
        threads: int | None = None,
        lanes: int | None = None,
        sweeps: int = SWEEPS,
        max_speed: float = MAX_SPEED,
    ):
        if not sweeps >= 1:
            raise ValueError(f"sweeps must be at least 1, not {sweeps}")
        if not max_speed > 0:
            raise ValueError(f"max_speed must be positive, not {max_speed}")
        super().__init__(model, world_count, device, threads, lanes)
        self._tree.sweeps = sweeps
        self._tree.max_speed = max_speed
        self._targets_set = False
        self._ports: dict[str, wp.array[Any, Any]] = {}
        self._row = self.new_rows()
        self._pool_blocks: tuple[Layout, wp.array[Any, Any]] | None = None
        inputs = [self._row, self._carried, self._blocks, self._carried, self._blocks]
        self._copy = self.prepared(self.program("place"), "place", inputs)
        self.reset()

    # --------------------------------------------------------------------------------------- the edge

    def port(self, name: str) -> wp.array[Any, Any]:
        """Live memory `(world_count, n)` of joint_q, joint_qd, joint_target_q or joint_f: it shows what the
        worlds have, and what is written to it they have, on every device and at every lane count. From the
        first call on, each step costs the two copies that this takes; one lane has none, as its worlds lie
        like that anyway. To open joint_target_q is to set targets: a reset leaves them alone from then on."""
        if name not in PORTS:
            raise ValueError(f"no port {name!r}; there are {', '.join(PORTS)}")
        lanes = getattr(self._world, PORTS[name])
        if name == "joint_target_q":
            self._targets_set = True
        if self.lanes == 1:
            return lanes[: self.world_count]
        if name not in self._ports:
            self._ports[name] = self.new_port(lanes.shape[1])
            self.run(self.program("port"), "show", [lanes, self._ports[name]])
        return self._ports[name]

    def _take_over(self) -> None:
        """What was written to ports becomes the worlds'."""
        for name, port in self._ports.items():
            self.run(self.program("port"), "read", [getattr(self._world, PORTS[name]), port])

    @contextlib.contextmanager
    def _changing(self) -> Iterator[None]:
        """Around what changes the worlds: open ports are read before it and show what became of it."""
        self._take_over()
        yield
        for name, port in self._ports.items():
            self.run(self.program("port"), "show", [getattr(self._world, PORTS[name]), port])

    # ------------------------------------------------------------------------------------ control

    def _values(self, name: str, values: Any, n: int, count: int) -> np.ndarray:
        """Checked `(n,)` or `(count, n)` float32, from NumPy or torch."""
        values = as_array(values)
        if values.shape not in ((n,), (count, n), (1, n)):
            raise ValueError(f"{name} must have shape ({n},) or ({count}, {n}), not {values.shape}")
        if not np.isfinite(values).all():
            raise ValueError(f"{name} has values that are not finite")
        return values

    def _unit(self, q: np.ndarray, name: str) -> np.ndarray:
        """joint_q with its quaternions normalised."""
        q = q.copy()
        for k in self.model.quaternions():
            length = np.linalg.norm(q[..., k : k + 4], axis=-1, keepdims=True)
            if (length < 0.1).any():
                raise ValueError(f"{name}[{k}:{k + 4}] must be a unit quaternion (xyzw)")
            q[..., k : k + 4] /= length
        return q

    def reset(self, worlds: Any = None, joint_q: Any = None, joint_qd: Any = None) -> None:
        """Put worlds into a state: by default all of them, the model's start pose, at rest.

        joint_q: (nq,) or (len(worlds), nq) [m, rad, -]; joint_qd likewise (nv) [m/s, rad/s]. Clears
        status and contact history. Where no targets were set yet, the pose becomes the target.
        """
        worlds = self._worlds(worlds)
        model = self.model
        if joint_q is None:
            joint_q = model.start_q
        q = self._unit(self._values("joint_q", joint_q, model.nq, len(worlds)), "joint_q")
        qd = np.zeros(model.nv) if joint_qd is None else joint_qd
        qd = self._values("joint_qd", qd, model.nv, len(worlds))
        if len(np.atleast_2d(q)) < len(np.atleast_2d(qd)):
            q = np.broadcast_to(q, (len(worlds), model.nq))
        pool = State.of(model, q, qd, self.device)
        rows = np.full(self.world_count, -1)
        rows[worlds] = np.arange(len(worlds)) if len(pool) == len(worlds) else 0
        self.place(pool, rows)
        if not self._targets_set:
            self._write("target", worlds, q)

    def place(self, pool: State, rows: Any = None) -> None:
        """Put worlds into states of a pool, in one launch: each into its row of `rows` (world_count,), -1
        leaves a world alone; by default world k into state k. Targets, forces and parameters stay. Raises
        ValueError for states of another model."""
        if apart := pool.layout.unlike(self._layout):
            raise ValueError(f"the pool's states are of another model: {apart[0]} differs in size")
        if rows is None:
            if len(pool) != self.world_count:
                raise ValueError(f"the pool has {len(pool)} states for {self.world_count} worlds: give rows")
            if pool.layout == self._layout and pool.data.device == self.device:
                with self._changing():
                    wp.copy(self._carried, pool.data)
                return
            rows = np.arange(self.world_count)
        rows = np.asarray(rows)
        if rows.shape != (self.world_count,) or not np.issubdtype(rows.dtype, np.integer):
            raise ValueError(f"rows must be {self.world_count} whole numbers, one for each world")
        if rows.max(initial=-1) >= len(pool) or rows.min(initial=0) < -1:
            raise IndexError(f"rows must lie in -1 .. {len(pool) - 1}")
        if self._pool_blocks is None or self._pool_blocks[0] != pool.layout:
            self._pool_blocks = pool.layout, self._block_table(pool.layout)
        blocks = self._pool_blocks[1]
        self.set_rows(self._row, rows)
        with self._changing():
            inputs = [self._row, pool.data.to(self.device), blocks, self._carried, self._blocks]
            self.run(self.program("place"), "place", inputs)

    def state(self) -> State:
        """What all worlds have now, contact history and status included, for `place`."""
        self._take_over()
        return State(wp.clone(self._carried), self._layout)

    def copy_worlds(self, sources: Any) -> None:
        """Give every world the state of another: world k becomes what world `sources[k]` (world_count,)
        is now, its contact history and status included. Targets, forces and parameters stay."""
        sources = self._worlds(sources)
        if sources.shape != (self.world_count,):
            raise ValueError(f"sources must have shape ({self.world_count},), not {sources.shape}")
        self._take_over()
        if (sources[sources] != sources).any():  # a world that is copied from changes, too
            return self.place(self.state(), sources)
        self.set_rows(self._row, np.where(sources == np.arange(self.world_count), -1, sources))
        with self._changing():
            self._copy()

    def set_targets(self, joint_target_q: Any) -> None:
        """Targets of the drives: (nq,) or (world_count, nq), laid out as joint_q."""
        target = self._values("joint_target_q", joint_target_q, self.model.nq, self.world_count)
        target = self._unit(target, "joint_target_q")
        with self._changing():
            self._write("target", np.arange(self.world_count), target)
        self._targets_set = True

    def set_joint_force(self, joint_f: Any) -> None:
        """Generalised forces on all dofs, until changed: (nv,) or (world_count, nv) [N, N m]."""
        f = self._values("joint_f", joint_f, self.model.nv, self.world_count)
        with self._changing():
            self._write("joint_f", np.arange(self.world_count), f)

    def apply_force(self, body: str | int, force: Any, worlds: Any = None) -> None:
        """A force (3,) or (len(worlds), 3) [N, world axes] at a body's centre of mass, until changed."""
        worlds = self._worlds(worlds)
        body = self.model.body(body) if isinstance(body, str) else int(body)
        if not 0 <= body < self.model.nbody:
            raise IndexError(f"body must lie in 0 .. {self.model.nbody - 1}, not {body}")
        force = self._values("force", force, 3, len(worlds))
        self._write("force", worlds, np.atleast_2d(force), column=body)
        self.forced = True

    def set_root_drive(
        self,
        kp_linear: float,
        kd_linear: float,
        kp_angular: float,
        kd_angular: float,
        joint: str | None = None,
    ) -> None:
        """Virtual drive that pulls a free joint (default: the first) towards its target, with the same
        implicit law as the other drives; zeros set it free. [N/m, N s/m, N m/rad, N m s/rad]"""
        model = self.model
        free = [name for name in model.joint_names if model.joint_type(name) == "free"]
        if not free:
            raise ValueError("the model has no free joint")
        if joint is not None and joint not in free:
            raise ValueError(f"{joint!r} is not a free joint; there are: {', '.join(free)}")
        first = model.dof_slice(joint or free[0]).start
        for name, linear, angular in (
            ("dof_kp", kp_linear, kp_angular),
            ("dof_kd", kd_linear, kd_angular),
        ):
            gains = getattr(self._tree, name).numpy().copy()
            gains[first : first + 3], gains[first + 3 : first + 6] = linear, angular
            getattr(self._tree, name).assign(gains)

    def step(self, count: int = 1) -> None:
        """Advance all worlds by `count` steps of `model.timestep`."""
        self.advancing(count, self._program.Course(), self._program.Watch())()

    def advancing(self, count: int, course: Any, watch: Any) -> Callable[[], None]:
        """What does the same along a `Course`, watched by a `Watch`, both of the kernels; to be called many
        times."""
        alone = self._tree.loose or self._tree.tumbler_count
        program = self.program("loose") if alone else self._program
        launch = self.prepared(program, "step", [count, course, watch])

        def advance() -> None:
            with self._changing():
                launch()

        return advance

    @property
    def forced(self) -> bool:
        """Whether any external force was ever applied; kernels look for them from then on."""
        return bool(self._tree.forced)

    @forced.setter
    def forced(self, on: bool) -> None:
        if on != self.forced:
            self._tree.forced = int(on)
            self._tree_version += 1

    # ------------------------------------------------------------------------------- observations

    @property
    def joint_q(self) -> np.ndarray:
        """(world_count, nq) [m, rad, -]"""
        self._take_over()
        return self._read(self._world.q)

    @property
    def joint_qd(self) -> np.ndarray:
        """(world_count, nv) [m/s, rad/s]"""
        self._take_over()
        return self._read(self._world.qd)

    @property
    def torch(self) -> Tensors:
        """The state as torch tensors: live memory, see `port`"""
        return Tensors(self)

    def bodies(self) -> tuple[np.ndarray, np.ndarray]:
        """`body_q` and `body_qd`, in one go"""
        n = self.model.nbody
        self._take_over()
        pose, velocity = self.new_port(7 * n), self.new_port(6 * n)
        self.run(self.program("observe"), "bodies", [pose, velocity])
        shape = (self.world_count, n, -1)
        return pose.numpy().reshape(shape), velocity.numpy().reshape(shape)

    @property
    def body_q(self) -> np.ndarray:
        """(world_count, nbody, 7): position [m] and quaternion xyzw of each body's frame"""
        return self.bodies()[0]

    @property
    def body_qd(self) -> np.ndarray:
        """(world_count, nbody, 6): velocity of each body's centre of mass [m/s], angular velocity [rad/s],
        along the world's axes"""
        return self.bodies()[1]

    @property
    def status(self) -> np.ndarray:
        """(world_count,) bit mask since the last reset: `NONFINITE`, `FALL` (a part of the player other
        than its feet touched the ground), `BAD_CONTACT` (the ball touched it elsewhere than on a hand),
        `OVERSPEED` (a joint was held back to `max_speed`), `FAR` (a free joint was so far from the origin,
        1.7 km at 10 ms, that single precision loses slow motion)"""
        flags = {
            "broken": NONFINITE,
            "fallen": FALL,
            "fumbled": BAD_CONTACT,
            "hurried": OVERSPEED,
            "strayed": FAR,
        }
        bits = [
            bit * (self._read(getattr(self._world, name))[:, 0] > 0).astype(np.int32)
            for name, bit in flags.items()
        ]
        return np.asarray(np.sum(bits, axis=0, dtype=np.int32))

    def contacts(self) -> Contacts:
        """Every slot of every world: its gap now, and the impulse of the last step."""
        self._take_over()
        self.run(self.program("observe"), "gaps", [])
        model, world = self.model, self._world
        count = self._tree.slot_count
        impulse = self._read(world.impulse)[:, :count]
        flights = model.tables.get("flight_slot", np.zeros(0, int))
        impulse[:, flights, 0] += self._read(world.knock)[:, : len(flights)]
        pairs = model.tables.get("slot_pair", np.zeros(0, int))
        shapes = [model.pairs[pair]["shapes"] for pair in pairs]
        return Contacts(
            shapes=[(model.shapes[a].name, model.shapes[b].name) for a, b in shapes],
            gap=self._read(world.gap)[:, :count],
            point=self._read(world.point)[:, :count],
            normal=self._read(world.normal)[:, :count],
            impulse=impulse,
        )

    def copy_contact_history(self, other: Simulation) -> None:
        """Take over another simulation's impulses of the last step, from which a solve starts."""
        same = (other.model is self.model, other.lanes == self.lanes, other.world_count == self.world_count)
        if not all(same):
            raise ValueError("the other simulation must have the same model, lanes and world_count")
        wp.copy(self._world.impulse, other._world.impulse)

    def contact_residual(self) -> np.ndarray:
        """(world_count,) largest velocity [m/s] by which a contact of the last step misses its law"""
        out = self._allocate(1, self._program.Real)
        self.run(self._program, "run_residual", [out])
        return self._read(out)[:, 0]

    def mass_matrix(self) -> np.ndarray:
        """(world_count, nv, nv) joint-space inertia, armature included [kg, kg m, kg m^2]"""
        M = self._allocate(self.model.nv**2, self._program.Real)
        self._take_over()
        self.run(self.program("observe"), "mass_matrix", [M])
        return self._read(M).reshape(self.world_count, self.model.nv, self.model.nv)

    def bias_force(self) -> np.ndarray:
        """(world_count, nv) Coriolis, centrifugal and gravity force, as they stand on the left of
        M qdd + bias = f [N, N m]; applied external forces count in"""
        C = self._allocate(self.model.nv, self._program.Real)
        self._take_over()
        self.run(self.program("observe"), "bias_force", [C])
        return self._read(C)

    # ------------------------------------------------------------------------- parameters by world

    def set_contact(
        self,
        a: str,
        b: str,
        restitution: float | np.ndarray | None = None,
        friction: float | np.ndarray | None = None,
        worlds: Any = None,
    ) -> None:
        """Set the restitution and friction [-] of every contact between two shapes or bodies, in some
        worlds; a number, or one per world. Raises ValueError where a and b cannot touch."""
        worlds = self._worlds(worlds)
        names = self._shape_groups()
        for name in (a, b):
            if name not in names:
                raise ValueError(f"no shape or body named {name!r}")
        found = [
            k
            for k, pair in enumerate(self.model.pairs)
            for x, y in (pair["shapes"], pair["shapes"][::-1])
            if x in names[a] and y in names[b]
        ]
        if not found:
            raise ValueError(f"{a!r} and {b!r} never touch in this model")
        for name, value in (("restitution", restitution), ("friction", friction)):
            if value is None:
                continue
            value = np.asarray(value, np.float32)
            if not np.isfinite(value).all() or (value < 0).any():
                raise ValueError(f"{name} must not be negative")
            for k in found:
                self._write(name, worlds, value.reshape(-1, 1), column=k)

    def _shape_groups(self) -> dict[str, set[int]]:
        groups: dict[str, set[int]] = {}
        for k, shape in enumerate(self.model.shapes):
            groups.setdefault(shape.name, set()).add(k)
            body = "world" if shape.body < 0 else self.model.body_names[shape.body]
            groups.setdefault(body, set()).add(k)
        return groups

    def set_mass(self, body: str, mass: float | np.ndarray, worlds: Any = None) -> None:
        """Set a body's mass [kg] in some worlds, its inertia in proportion; a number, or one per world."""
        worlds = self._worlds(worlds)
        b = self.model.body(body)
        link = int(self.model.tables["body_link"][b])
        if link == 0 or (self.model.tables["body_link"] == link).sum() > 1:
            raise ValueError(f"body {body!r} is fixed to another: its mass cannot be set alone")
        mass = np.asarray(mass, np.float32)
        if not np.isfinite(mass).all() or (mass <= 0).any():
            raise ValueError("mass must be positive")
        self._write("mass_scale", worlds, (mass / self.model.body_mass[b]).reshape(-1, 1), column=link)
