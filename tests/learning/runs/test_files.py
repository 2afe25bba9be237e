"""Arrays in files, damaged ones, files as memory, and who holds a folder."""

import multiprocessing
import os
import signal
import socket
import sys

import numpy as np
import pytest

from warpdribble.learning.runs.files import (
    LOCK,
    held,
    mapped,
    read_arrays,
    said_if_damaged,
    write_arrays,
    write_json,
)
from warpdribble.sims.errors import InputError


def test_arrays_come_back(tmp_path):
    arrays = {"a.b": np.arange(6.0).reshape(2, 3), "n": np.array(3), "none": np.zeros((0, 2), int)}
    write_arrays(tmp_path / "x.npz", arrays)
    read = read_arrays(tmp_path / "x.npz", "delete it")
    assert read.keys() == arrays.keys()
    for name, value in arrays.items():
        np.testing.assert_array_equal(read[name], value)
        assert read[name].dtype == value.dtype
    assert [p.name for p in tmp_path.iterdir()] == ["x.npz"]


def test_what_cannot_be_written_leaves_what_was_there(tmp_path):
    write_json(tmp_path / "x.json", {"a": 1})
    with pytest.raises(TypeError):
        write_json(tmp_path / "x.json", {"a": object()})
    assert (tmp_path / "x.json").read_text() == '{\n  "a": 1\n}\n'
    assert [p.name for p in tmp_path.iterdir()] == ["x.json"]


@pytest.mark.parametrize("data", [b"", b"PK\x03\x04 half", b"no zip at all"])
def test_a_damaged_file_is_said(tmp_path, data):
    (tmp_path / "x.npz").write_bytes(data)
    with pytest.raises(InputError, match=r"x\.npz: is damaged \(.+\): delete it") as error:
        read_arrays(tmp_path / "x.npz", "delete it", "out")
    assert "\n" not in str(error.value) and error.value.hint == "out"


def test_a_file_with_objects_is_not_unpickled(tmp_path):
    np.savez(tmp_path / "x.npz", a=np.array([print], dtype=object))
    with pytest.raises(InputError, match="is damaged"):
        read_arrays(tmp_path / "x.npz", "delete it")


def test_what_is_not_there_is_not_damaged(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_arrays(tmp_path / "x.npz", "delete it")
    with pytest.raises(ZeroDivisionError), said_if_damaged(tmp_path, "delete it"):
        raise ZeroDivisionError


# -------------------------------------------------------------------------------------- file as memory


def test_a_mapped_file_keeps_what_is_written(tmp_path):
    path = tmp_path / "buffer.npy"
    array = mapped(path, (4, 3))
    assert array.dtype == np.float32 and not array.any()
    array[1] = 2.0
    array.flush()
    again = mapped(path, (4, 3))
    np.testing.assert_array_equal(again[1], [2.0, 2.0, 2.0])
    assert not again[2:].any() and path.stat().st_size < 300


@pytest.mark.parametrize(("shape", "dtype"), [((4, 2), np.float32), ((5, 3), np.float32), ((4, 3), float)])
def test_a_mapped_file_of_another_kind_is_refused(tmp_path, shape, dtype):
    mapped(tmp_path / "buffer.npy", (4, 3))
    with pytest.raises(InputError, match=r"buffer\.npy: has \(4, 3\) float32, not "):
        mapped(tmp_path / "buffer.npy", shape, dtype)


def test_a_mapped_file_that_is_cut_off_is_said(tmp_path):
    mapped(tmp_path / "buffer.npy", (400, 3)).flush()
    data = (tmp_path / "buffer.npy").read_bytes()
    (tmp_path / "buffer.npy").write_bytes(data[:100])
    with pytest.raises(InputError, match=r"buffer\.npy: is damaged"):
        mapped(tmp_path / "buffer.npy", (400, 3))


# ------------------------------------------------------------------------------------------- the lock


def test_a_folder_is_held_by_one(tmp_path):
    with held(tmp_path):
        said = rf"is being written by process {os.getpid()} on {socket.gethostname()} since 20\d\d-"
        with pytest.raises(InputError, match=said), held(tmp_path):
            pytest.fail("held twice")
        assert (tmp_path / LOCK).exists()
        with held_elsewhere(tmp_path) as let_in:
            assert not let_in
    assert not (tmp_path / LOCK).exists()
    with held_elsewhere(tmp_path) as let_in:
        assert let_in


def test_an_error_lets_go(tmp_path):
    with pytest.raises(ZeroDivisionError), held(tmp_path):
        raise ZeroDivisionError
    assert not (tmp_path / LOCK).exists()
    with held(tmp_path):
        pass


class Bytes:
    """Locks of bytes as Windows has them, in place of its module: from where a file is."""

    LK_NBLCK = 2

    def __init__(self):
        self.taken = {}

    def locking(self, file, mode, count):
        assert mode == self.LK_NBLCK
        at = os.lseek(file, 0, os.SEEK_CUR)
        for byte in range(at, at + count):
            if self.taken.setdefault(byte, file) != file:
                raise PermissionError


def test_a_folder_is_held_by_one_on_windows(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setitem(sys.modules, "msvcrt", locks := Bytes())
    with held(tmp_path):
        text = (tmp_path / LOCK).read_text()
        assert text.startswith(f"process {os.getpid()} on ")
        assert not locks.taken.keys() & range(len(text) + 1)  # nobody else could read those
        with pytest.raises(InputError, match=text.strip()), held(tmp_path):
            pytest.fail("held twice")


def hold(folder, pipe):
    try:
        with held(folder):
            pipe.send(True)
            pipe.recv()
    except InputError:
        pipe.send(False)


class held_elsewhere:
    """Another process that tries to hold a folder; whether it does."""

    def __init__(self, folder):
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=hold, args=(folder, other))

    def __enter__(self):
        self.process.start()
        return self.pipe.recv()

    def __exit__(self, *_):
        self.pipe.send(None)
        self.process.join()


def test_a_killed_process_holds_nothing(tmp_path):
    other = held_elsewhere(tmp_path)
    assert other.__enter__()
    with pytest.raises(InputError, match=rf"process {other.process.pid} on "), held(tmp_path):
        pytest.fail("held twice")
    os.kill(other.process.pid, signal.SIGKILL)
    other.process.join()
    assert str(other.process.pid) in (tmp_path / LOCK).read_text()
    with held(tmp_path):
        assert str(os.getpid()) in (tmp_path / LOCK).read_text()
        assert str(other.process.pid) not in (tmp_path / LOCK).read_text()
    assert not (tmp_path / LOCK).exists()


def test_a_lock_that_was_taken_away_meanwhile_is_not_held(tmp_path, monkeypatch):
    """Between opening and locking, who held it has removed it, so that another may make a new one."""
    from warpdribble.learning.runs import files

    lock = files._lock

    def late(file):
        (tmp_path / LOCK).unlink()
        (tmp_path / LOCK).write_text("process 1 on elsewhere")
        return lock(file)

    monkeypatch.setattr(files, "_lock", late)
    with pytest.raises(InputError, match="is being written by"), held(tmp_path):
        pytest.fail("held a lock that is gone")
    assert (tmp_path / LOCK).read_text() == "process 1 on elsewhere"
