"""What a learning run writes down as it goes: a row per iteration as CSV, and the same for TensorBoard."""

from __future__ import annotations

import csv
import math
import os
import time
from pathlib import Path
from typing import Any

from ...sims.errors import InputError
from ...sims.files import whole

TABLE, EVENTS = "progress.csv", "tensorboard"


class Log:
    """Rows of numbers by iteration, in a run's folder."""

    def __init__(self, folder: Path, names: list[str], done: int):
        """names: the columns; the first is the iteration, the last the time [s]. done: iterations that count;
        what was written of later ones is dropped."""
        path = folder / TABLE
        rows = [row for row in read_rows(folder) if row[names[0]] <= done]
        if rows and list(rows[0]) != names:
            raise InputError("has other columns, by another version", path, "out")
        with whole(path) as part, open(part, "w", newline="") as file:
            table = csv.writer(file)
            table.writerow(names)
            table.writerows(row.values() for row in rows)
        self._file = open(path, "a", newline="")  # noqa: SIM115
        self._names = names
        self._table = csv.writer(self._file)
        self._events = _event_writer(folder / EVENTS, rows, names)

    @property
    def has_events(self) -> bool:
        """Whether TensorBoard's package is here, so that its files are written."""
        return self._events is not None

    def add(self, row: dict[str, float]) -> None:
        """Write a row; it is on the disk afterwards."""
        self._table.writerow(row[name] for name in self._names)
        self._file.flush()
        os.fsync(self._file.fileno())
        if self._events is not None:
            _add_event(self._events, row, self._names, time.time())
            self._events.flush()

    def close(self) -> None:
        self._file.close()
        if self._events is not None:
            self._events.close()


def read_rows(folder: str | Path) -> list[dict[str, float]]:
    """The rows of a run so far; one that was cut off in the middle is left out."""
    try:
        with open(Path(folder) / TABLE, newline="", errors="replace") as file:
            rows = list(csv.DictReader(file))
    except FileNotFoundError:
        return []
    read = []
    for row in rows:
        try:
            read.append({k: int(v) if v.lstrip("-").isdigit() else float(v) for k, v in row.items()})
        except (AttributeError, TypeError, ValueError):
            continue
    return read


def _event_writer(folder: Path, rows: list[dict[str, float]], names: list[str]) -> Any:
    """A new event file with the rows so far, in place of those that are there; None where TensorBoard's
    package is missing.

    Written anew since event files of one second have no order, and TensorBoard reads them by their names.
    """
    try:
        from tensorboard.compat.proto.event_pb2 import Event, SessionLog
        from tensorboard.summary.writer.event_file_writer import EventFileWriter
    except ModuleNotFoundError:
        return None
    old = list(folder.glob("events.out.tfevents.*"))
    writer = EventFileWriter(str(folder))
    restart = SessionLog(status=SessionLog.START)  # a TensorBoard that looks on forgets what it has
    writer.add_event(Event(wall_time=time.time(), session_log=restart))
    for row in rows:
        _add_event(writer, row, names, time.time() - rows[-1][names[-1]] + row[names[-1]])
    writer.flush()
    for file in old:
        file.unlink()
    return writer


def _add_event(writer: Any, row: dict[str, float], names: list[str], when: float) -> None:
    """when: [s] since 1970"""
    from tensorboard.compat.proto.event_pb2 import Event
    from tensorboard.compat.proto.summary_pb2 import Summary

    step, *tags = names
    finite = [Summary.Value(tag=tag, simple_value=row[tag]) for tag in tags if math.isfinite(row[tag])]
    writer.add_event(Event(wall_time=when, step=row[step], summary=Summary(value=finite)))
