"""Fetching works against a mirror here: no test uses the network."""

import functools
import hashlib
import http.server
import threading

import pytest

from warpdribble.cli import main
from warpdribble.clips import data
from warpdribble.clips.data import Entry, FetchError, entries, fetch

FILES = {"cmu/a.bvh": b"first", "cmu/b.bvh": b"second"}


@pytest.fixture
def few(monkeypatch):
    """Two small files instead of the set."""
    known = [Entry(f, hashlib.sha256(d).hexdigest(), len(d), "") for f, d in FILES.items()]
    monkeypatch.setattr(data, "entries", lambda name: known)


@pytest.fixture
def mirror(tmp_path):
    folder = tmp_path / "mirror"
    for file, content in FILES.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_bytes(content)
    return folder


def files(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize("flat", [False, True])
def test_from_a_folder(few, mirror, tmp_path, flat):
    to = tmp_path / "data"
    brought, unknown = fetch("cmu", to, str(mirror / "cmu" if flat else mirror))
    assert [p.relative_to(to).as_posix() for p in brought] == list(FILES) and not unknown
    assert files(to) == FILES


def test_from_a_url_and_only_once(few, mirror, tmp_path):
    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *args):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=mirror))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    url = f"http://127.0.0.1:{server.server_port}"
    fetch("cmu", tmp_path / "data", url)
    server.shutdown()
    server.server_close()
    assert files(tmp_path / "data") == FILES
    fetch("cmu", tmp_path / "data", url)  # all there: nothing is asked for
    with pytest.raises(FetchError, match=r"cmu/a.bvh: .*could not be reached") as error:
        fetch("cmu", tmp_path / "other", url)
    assert error.value.hint == "files"
    assert not files(tmp_path / "other")


def test_another_file_is_refused_and_leaves_nothing(few, mirror, tmp_path):
    (mirror / "cmu" / "a.bvh").write_bytes(b"something else")
    with pytest.raises(FetchError, match=r"cmu/a.bvh.*sha256"):
        fetch("cmu", tmp_path / "data", str(mirror))
    assert not files(tmp_path / "data")


def test_a_damaged_file_is_brought_again(few, mirror, tmp_path):
    fetch("cmu", tmp_path / "data", str(mirror))
    (tmp_path / "data" / "cmu" / "a.bvh").write_bytes(b"fir")
    fetch("cmu", tmp_path / "data", str(mirror))
    assert files(tmp_path / "data") == FILES


def test_what_is_missing_is_said(few, mirror, tmp_path):
    assert fetch("cmu", tmp_path / "data") == ([], list(FILES))
    (mirror / "cmu" / "b.bvh").unlink()
    with pytest.raises(FetchError, match=r"no cmu/b\.bvh"):
        fetch("cmu", tmp_path / "data", str(mirror))
    with pytest.raises(FetchError, match="no such folder"):
        fetch("cmu", tmp_path / "data", str(tmp_path / "nowhere"))


def test_the_index():
    assert (len(entries("cmu")), len(entries("ballplay"))) == (20, 89)
    everything = [*entries("cmu"), *entries("ballplay")]
    public = [entry for entry in everything if entry.url]
    assert len(public) == 105
    assert all(len(entry.sha256) == 64 and entry.size > 1000 for entry in everything)
    assert all(entry.url.endswith(entry.file.partition("/")[2]) for entry in public)
    with pytest.raises(ValueError, match="no data set"):
        entries("lafan")


@pytest.mark.parametrize("name", ["cmu", "ballplay"])
def test_the_command_says_licence_and_citation(capsys, mocap, tmp_path, name):
    assert main(["fetch", name, "--to", str(tmp_path), "--mirror", str(mocap)]) == 0
    said = capsys.readouterr().out
    for word in ("licence", "cite", "home", "checksums compared"):
        assert word in said
    assert len(files(tmp_path)) == len(entries(name))


def test_the_command_refuses_in_one_line(capsys, tmp_path):
    assert main(["fetch", "cmu", "--to", str(tmp_path), "--mirror", str(tmp_path / "no")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "no such folder" in said
