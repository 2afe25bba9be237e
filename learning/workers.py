"""Workers that share out jobs: threads, as simulating, which is most of a job, runs beside other Python.

Results come in the jobs' order, and no job knows which worker does it: what is computed does not depend on
how many there are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from ..sims.worlds.cores import usable_cores

T = TypeVar("T")


class Workers:
    """So many at work at once."""

    def __init__(self, count: int):
        self.count = count
        self._pool = ThreadPoolExecutor(count) if count > 1 else None

    def each(self, job: Callable[..., T], arguments: Iterable[tuple[Any, ...]]) -> list[T]:
        """What `job` returns for each of the arguments, in their order. Jobs that may run at once must not
        share what they change: where there are more jobs than workers, give every worker's things to its
        own."""
        if self._pool is None:
            return [job(*several) for several in arguments]
        return [future.result() for future in [self._pool.submit(job, *several) for several in arguments]]


def usual_workers(device: str) -> int:
    """One for each processor core that may be used; on a GPU one."""
    return usable_cores() if device == "cpu" else 1


def shares(count: int, workers: int) -> list[int]:
    """How many of `count` jobs each worker gets: as equal as can be, the larger first."""
    return [count // workers + (i < count % workers) for i in range(workers)]
