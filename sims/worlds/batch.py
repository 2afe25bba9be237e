"""`Batch`: how many worlds lie in memory, and how kernels are launched over them."""

from __future__ import annotations

import contextlib
import platform
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import warp as wp

from ... import kernels
from ...kernels import loading
from ..model import Model
from .cores import usable_cores
from .state import QUANTITIES, Block, Layout

RESPONSE_ROOM = 1130
"""Entries of 12 bytes for the responses of touching slots in each world; see `kernels.contact`."""


SLOW = 0.01
"""Places are too far where a step at this speed [m/s] may be less than half of what single precision tells
apart."""


def widest_lanes() -> int:
    """Worlds that one vector register of this processor holds."""
    machine = platform.machine().lower()
    if machine in ("aarch64", "arm64"):
        return 4
    try:
        flags = Path("/proc/cpuinfo").read_text()
    except OSError:
        return 8 if machine in ("x86_64", "amd64") else 4
    return 16 if "avx512f" in flags else 8 if "avx2" in flags else 4


def find_device(name: str) -> wp.Device:
    """Warp's device of that name. Raises ValueError with those that there are."""
    try:
        if name.startswith("cuda") and not wp.is_cuda_available():
            raise ValueError(name)  # to ask the driver would have Warp say so on stderr
        return wp.get_device(name)
    except (ValueError, RuntimeError):
        there = ", ".join(str(device) for device in wp.get_devices())
        raise ValueError(f"no device {name!r} here; there are: {there}") from None


_LOADED: set[tuple[ModuleType, str]] = set()
_LOADING = threading.Lock()
_TOLD: list[Callable[[], object]] = []


def cached(program: ModuleType, device: wp.Device) -> bool:
    """Whether kernels lie compiled in Warp's cache, so that loading them takes no compiler."""
    return loading.cached(program.__name__, device)


@contextlib.contextmanager
def telling(compiles: Callable[[], object]) -> Iterator[None]:
    """Meanwhile, call `compiles` before kernels are compiled, which takes seconds; not where they are
    cached."""
    _TOLD.append(compiles)
    try:
        yield
    finally:
        _TOLD.remove(compiles)


def _load(program: ModuleType, device: wp.Device) -> None:
    """Compile and load kernels, once in a process: to load them again would take away the code that another
    thread may be running."""
    with _LOADING:
        if (program, device.alias) not in _LOADED:
            if _TOLD and not cached(program, device):
                for compiles in _TOLD:
                    compiles()
            program.load(device)
            _LOADED.add((program, device.alias))


class Batch:
    """Worlds in groups of `lanes`: a group is what one pass of a kernel steps.

    State arrays are `(groups, n)`. On a CPU a group's row is contiguous, each number being a vector of
    its worlds; on CUDA a group is one world, and neighbouring worlds lie side by side.
    """

    def __init__(self, model: Model, world_count: int, device: str, threads: int | None, lanes: int | None):
        if world_count < 1:
            raise ValueError(f"world_count must be at least 1, not {world_count}")
        if threads is not None and threads < 1:
            raise ValueError(f"threads must be at least 1, not {threads}")
        self.model = model
        self.world_count = world_count
        self.device = find_device(device)
        on_cpu = self.device.is_cpu
        self.lanes: int = lanes or (widest_lanes() if on_cpu else 1)
        if not on_cpu and self.lanes != 1:
            raise ValueError("lanes are for the CPU; on CUDA leave them out")
        self._side_by_side = not on_cpu
        self._program = kernels.program(self.lanes)
        self.groups = -(-world_count // self.lanes)
        self.threads = min(threads or usable_cores(), self.groups) if on_cpu else 1
        self._pool = ThreadPoolExecutor(max(1, self.threads - 1))
        self._tree = self._make_tree()
        self._tree_version = 0
        self._world = self._make_world()
        self._fill_defaults()

    def program(self, module: str) -> ModuleType:
        """A kernel module for this batch's lanes."""
        return kernels.program(self.lanes, module)

    def _make_tree(self) -> Any:
        """The model as the kernels' `Tree`."""
        program, model = self._program, self.model
        tree = program.Tree()
        for name, var in program.Tree.vars.items():
            if isinstance(var.type, wp.array):
                rows = model.tables.get(name, np.zeros(0))
                rows = np.asarray(rows, np.int32 if var.type.dtype is wp.int32 else np.float32)
                setattr(tree, name, wp.array(rows, dtype=var.type.dtype, device=self.device))
        tree.h = model.timestep
        tree.far = SLOW * tree.h * 2.0**24
        tree.gravity = wp.vec3(*model.tables["gravity"])
        tree.link_count = len(model.tables["link_parent"]) - 1
        tree.q_count, tree.dof_count = model.nq, model.nv
        tree.slot_count = len(model.tables.get("slot_kind", ()))
        tree.flyer_count = len(model.tables.get("flyer_link", ()))
        tree.tumbler_count = len(model.tables["tumbler_link"])
        tree.loose = int(model.tables["link_loose"].any())
        tree.forced = 0
        lengths = model.tables.get("slot_length", np.zeros(0, int))
        tree.response_room = int(min(RESPONSE_ROOM, lengths.sum() + program.HEAD * len(lengths)))
        return tree

    def _make_world(self) -> Any:
        """State of all worlds, `(groups, n)` each."""
        program, model, tree = self._program, self.model, self._tree
        longest = int(max(model.tables.get("slot_length", np.zeros(1)), default=0)) + program.HEAD
        counts = {
            "q": model.nq,
            "dof": model.nv,
            "link": tree.link_count + 1,
            "loose": tree.loose * (tree.link_count + 1),
            "tumbler": tree.tumbler_count,
            "flight": len(model.tables.get("flight_slot", ())),
            "slot": tree.slot_count,
            "pair": len(model.pairs),
            "body": model.nbody,
            "world": 1,
            "response": tree.response_room + longest,
            "use": 2 * tree.slot_count + 2,
        }
        columns = {name: counts[kind] for kind, names in program.COLUMNS.items() for name in names.split()}
        world = program.World()
        types = {name: var.type.dtype for name, var in program.World.vars.items()}
        for name in types.keys() - set(program.CARRIED):
            setattr(world, name, self._allocate(columns[name], types[name]))
        self._lay_out(world, {name: (columns[name], types[name]) for name in program.CARRIED})
        return world

    def _lay_out(self, world: Any, arrays: dict[str, tuple[int, Any]]) -> None:
        """Arrays, `(count, type)` by name, one after the other in `_carried`, so that a world's state moves
        in one go."""
        lanes, groups = self.lanes, self.groups
        blocks, start = {}, 0
        public = {inside: name for name, inside in QUANTITIES.items()}
        for name, (count, dtype) in arrays.items():
            count = max(count, 1)
            parts = self._parts(dtype)
            strides = (count * parts * lanes, parts * lanes)
            if self._side_by_side:
                strides = (parts, groups * parts)
            blocks[public[name]] = Block(start, count, parts, lanes, *strides)
            start += groups * count * parts * lanes
        self._layout = Layout(self.world_count, start, blocks)
        self._carried = wp.zeros(start, dtype=float, device=self.device)
        for (name, (_, dtype)), block in zip(arrays.items(), blocks.values()):
            n = block.n
            shape = (n, groups) if self._side_by_side else (groups, n)
            array: Any = wp.array(
                ptr=self._carried.ptr + 4 * block.start, dtype=dtype, shape=shape, device=self.device
            )
            array._ref = self._carried  # as Warp's own views keep what they show
            setattr(world, name, array.transpose() if self._side_by_side else array)
        self._blocks = self._block_table(self._layout)

    def _block_table(self, layout: Layout) -> wp.array[Any, Any]:
        """The kernels' view of a layout, in the order of this batch's quantities."""
        block = self.program("place").Block
        absent = Block(0, 0, 1, 1, 0, 0)
        rows = [vars(layout.blocks.get(name, absent)).values() for name in QUANTITIES]
        table = np.array([[*row] for row in rows], np.int32).view(block.numpy_dtype()).ravel()
        return wp.array(table, dtype=block, device=self.device)

    def _parts(self, dtype: Any) -> int:
        """Floats that one number of an array has for each world."""
        return int(wp.types.type_size_in_bytes(dtype) // (4 * self.lanes))

    def _allocate(self, count: int, dtype: Any) -> wp.array[Any, Any]:
        """Zeros `(groups, count)`."""
        shape = (self.groups, max(count, 1))
        if self._side_by_side:
            return wp.zeros(shape[::-1], dtype=dtype, device=self.device).transpose()
        return wp.zeros(shape, dtype=dtype, device=self.device)

    def new_port(self, columns: int) -> wp.array[Any, Any]:
        """Zeros `(world_count, columns)`, for what crosses the edge; see `kernels.port`."""
        shape = (self.world_count, columns)
        if self._side_by_side:
            return wp.zeros(shape[::-1], dtype=float, device=self.device).transpose()
        return wp.zeros(shape, dtype=float, device=self.device)

    def new_rows(self) -> wp.array[Any, Any]:
        """Zeros `(world_count,)`, for the row of a table or a pool that each world has."""
        return wp.zeros(self.world_count, dtype=int, device=self.device)

    def set_rows(self, array: wp.array[Any, Any], rows: Any) -> None:
        """Set an array of `new_rows` (world_count,)."""
        if self.device.is_cpu:
            array.numpy()[:] = rows
        else:
            array.assign(np.broadcast_to(np.asarray(rows, np.int32), (self.world_count,)))

    def _fill_defaults(self) -> None:
        pairs = self.model.pairs
        everyone = np.arange(self.world_count)
        self._write("mass_scale", everyone, np.ones(self._tree.link_count + 1))
        for name in ("friction", "restitution"):
            if pairs:
                self._write(name, everyone, np.array([pair[name] for pair in pairs]))
        ground = np.array([0, 0, 0, 1], np.float32)
        self._write("turn", everyone, ground, column=0)
        self._write("R", everyone, np.eye(3, dtype=np.float32).ravel(), column=0)

    def _rows(self, array: wp.array[Any, Any]) -> np.ndarray:
        """An array as float32 `(groups, n, parts, lanes)`: on a CPU a view, on CUDA a copy."""
        rows = array.numpy()
        if self._side_by_side:
            rows = np.ascontiguousarray(rows)
        rows = rows.view(np.float32) if rows.dtype.fields else rows
        return rows.reshape(self.groups, array.shape[1], -1, self.lanes)

    def _read(self, array: wp.array[Any, Any]) -> np.ndarray:
        """`(world_count, n, parts)` of an array, parts dropped where there is one."""
        rows = self._rows(array).transpose(0, 3, 1, 2)
        rows = rows.copy()  # never a view of what the next step changes
        rows = rows.reshape(-1, *rows.shape[2:])[: self.world_count]
        return rows[..., 0] if rows.shape[-1] == 1 else rows

    def _write(self, name: str, worlds: np.ndarray, values: Any, column: int | None = None) -> None:
        """Set a state array of some worlds, or one column of it: `values` `(..., n * parts)`, for each
        world or for all. The unused worlds of the last group follow the last world."""
        array = getattr(self._world, name)
        if column is not None:
            array = array[:, column : column + 1]
        n, parts = array.shape[1], self._parts(array.dtype)
        values = np.asarray(values, np.float32)
        if values.ndim:
            values = values.reshape(-1, n, parts)
        values = np.broadcast_to(values, (len(worlds), n, parts))
        count = self.groups * self.lanes
        if len(worlds) == count and (worlds == np.arange(count)).all():  # all of them: the old do not count
            rows = values.reshape(self.groups, self.lanes, n, parts).transpose(0, 2, 3, 1)
        else:
            rows = self._rows(array)
            last = np.flatnonzero(worlds == self.world_count - 1)
            if len(last):
                spare = np.arange(self.world_count, count)
                worlds = np.concatenate([worlds, spare])
                values = np.concatenate([values, np.repeat(values[last[-1:]], len(spare), 0)])
            group, lane = np.divmod(worlds, self.lanes)
            rows[group, :, :, lane] = values
        self._assign(array, rows)

    def _assign(self, array: wp.array[Any, Any], rows: np.ndarray) -> None:
        """Set an array to float32 `(groups, n, parts, lanes)`, as `_rows` gives them."""
        if not self._side_by_side:
            there = self._rows(array)
            if not np.shares_memory(there, rows):
                there[:] = rows
            return
        kind: Any = array.dtype
        dtype = kind.numpy_dtype() if hasattr(kind, "numpy_dtype") else np.float32
        array.assign(np.ascontiguousarray(rows).reshape(-1).view(dtype).reshape(array.shape))

    def _worlds(self, worlds: Any) -> np.ndarray:
        if worlds is None:
            return np.arange(self.world_count)
        worlds = np.atleast_1d(np.asarray(worlds))
        if worlds.dtype == bool:
            if worlds.shape != (self.world_count,):
                raise ValueError(f"a mask of worlds must have shape ({self.world_count},)")
            return np.flatnonzero(worlds)
        if worlds.size and not np.issubdtype(worlds.dtype, np.integer):
            raise ValueError("worlds must be whole numbers or a mask")
        if worlds.size and not (worlds.min() >= 0 and worlds.max() < self.world_count):
            raise IndexError(f"worlds must lie in 0 .. {self.world_count - 1}")
        return worlds.astype(int)

    def launch(self, kernel: str, count: int = 1) -> None:
        """Run a kernel of `kernels.step`, the whole step or a part of it, `count` times."""
        self.run(self._program, kernel, [count])

    def run(self, program: ModuleType, kernel: str, inputs: list[Any]) -> None:
        """Launch a kernel over all groups, a slice of them per thread. program: a module of `program`;
        inputs: what follows tree, world and the first group."""
        self.prepared(program, kernel, inputs)()

    def prepared(self, program: ModuleType, kernel: str, inputs: list[Any]) -> Callable[[], None]:
        """What launches a kernel, to be called many times: arguments are packed once. What the arrays among
        the inputs hold may change, the inputs not."""
        function, size = getattr(program, kernel), -(-self.groups // self.threads)
        _load(program, self.device)
        commands: list[wp.Launch] = []
        tree = -1

        def launch() -> None:
            nonlocal tree
            if tree != self._tree_version:  # the tree is among the arguments
                tree = self._tree_version
                commands[:] = [
                    wp.launch(
                        function,
                        dim=min(size, self.groups - first),
                        inputs=[self._tree, self._world, first, *inputs],
                        device=self.device,
                        record_cmd=True,
                    )
                    for first in range(0, self.groups, size)
                ]
            others = [self._pool.submit(command.launch) for command in commands[1:]]
            commands[0].launch()  # this thread works too
            for other in others:
                other.result()

        return launch

    @property
    def memory_per_world(self) -> float:
        """Bytes of state a world takes."""
        arrays = (getattr(self._world, name) for name in self._program.World.vars)
        return float(sum(a.capacity for a in arrays) / (self.groups * self.lanes))
