"""Files that are whole at any moment: a writer that fails, is killed, or writes several."""

import multiprocessing
import os
import signal

import pytest

from warpdribble.sims.files import PART, check_folder, sweep, whole


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_file_appears_at_the_end_only(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with whole(path) as part:
        part.write_text("new")
        assert path.read_text() == "old" and part.name == "a.txt" and part != path
    assert path.read_text() == "new" and names(tmp_path) == ["a.txt"]


def test_a_writer_that_fails_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError), whole(path) as part:
        part.write_text("half")
        raise ZeroDivisionError
    assert path.read_text() == "old" and names(tmp_path) == ["a.txt"]


def test_a_writer_that_writes_nothing_fails(tmp_path):
    with pytest.raises(FileNotFoundError), whole(tmp_path / "a.txt"):
        pass
    assert names(tmp_path) == []


def test_files_beside_it_come_first(tmp_path, monkeypatch):
    """Whoever sees the named file finds what it refers to."""
    moved = []
    replace = os.replace
    monkeypatch.setattr(os, "replace", lambda a, b: (moved.append(b.name), replace(a, b)))
    with whole(tmp_path / "b.txt") as part:
        for name in ("c.txt", "b.txt", "a.txt"):
            part.with_name(name).write_text(name)
    assert moved == ["a.txt", "c.txt", "b.txt"] and names(tmp_path) == ["a.txt", "b.txt", "c.txt"]


def test_a_name_as_long_as_names_may_be(tmp_path):
    path = tmp_path / ("n" * 251 + ".txt")
    with whole(path) as part:
        part.write_text("x")
    assert path.read_text() == "x"


def _killed(path):
    with whole(path) as part:
        part.write_text("half")
        os.kill(os.getpid(), signal.SIGKILL)


def test_what_a_killed_writer_leaves_is_swept(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    writer = multiprocessing.get_context("fork").Process(target=_killed, args=(path,))
    writer.start()
    writer.join()
    (tmp_path / f"{PART}b.txt").write_text("half")
    assert path.read_text() == "old" and len(names(tmp_path)) == 3
    assert all(name.startswith(PART) for name in names(tmp_path) if name != "a.txt")
    sweep(tmp_path)
    assert path.read_text() == "old" and names(tmp_path) == ["a.txt"]


def test_a_folder_is_made_and_tried(tmp_path):
    check_folder(tmp_path / "new" / "folder")
    assert names(tmp_path / "new" / "folder") == []
    (tmp_path / "file").write_text("x")
    with pytest.raises(OSError):
        check_folder(tmp_path / "file" / "folder")
