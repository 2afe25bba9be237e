"""Skins in the cache: read by the next process, built again where they do not fit or cannot be read."""

import numpy as np
import pytest

from warpdribble.sims import Model
from warpdribble.skin import kept, skin


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setattr(kept, "folder", lambda: tmp_path / "skins")
    return tmp_path / "skins"


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "m.xml"
    path.write_text(
        '<mujoco><worldbody><body name="a"><freejoint name="j"/><geom name="g" type="sphere" size="0.1"/>'
        "</body></worldbody></mujoco>"
    )
    return path


def built(path, monkeypatch):
    """The skin of a model that was loaded anew, and how often one was built for it."""
    count = []
    real = skin._build

    def build(model):
        count.append(model)
        return real(model)

    with monkeypatch.context() as patch:
        patch.setattr(skin, "_build", build)
        return skin.of(Model.load(path)), len(count)


def test_the_next_process_reads_it(small, cache, monkeypatch):
    first, times = built(small, monkeypatch)
    assert times == 1 and [p.suffix for p in cache.iterdir()] == [".npz"]
    second, times = built(small, monkeypatch)
    assert times == 0
    for name in ("bodies", "weights", "region", "bind_q"):
        np.testing.assert_array_equal(getattr(second, name), getattr(first, name))
    for name, part in vars(first.mesh).items():
        np.testing.assert_array_equal(getattr(second.mesh, name), part)
    assert (second.regions, second.colours) == (first.regions, first.colours)


def test_another_model_has_its_own(small, cache, monkeypatch, tmp_path):
    built(small, monkeypatch)
    larger = tmp_path / "larger.xml"
    larger.write_text(small.read_text().replace('size="0.1"', 'size="0.12"'))
    one, times = built(larger, monkeypatch)
    assert times == 1 and len(list(cache.iterdir())) == 2
    np.testing.assert_allclose(np.linalg.norm(one.mesh.points, axis=1), 0.12, atol=0.003)


@pytest.mark.parametrize("spoilt", [b"", b"PK half a file", None])
def test_what_cannot_be_read_is_built_again(small, cache, monkeypatch, spoilt):
    built(small, monkeypatch)
    (file,) = cache.iterdir()
    if spoilt is None:
        np.savez(file, points=np.zeros(3))
    else:
        file.write_bytes(spoilt)
    assert built(small, monkeypatch)[1] == 1
    assert built(small, monkeypatch)[1] == 0


def test_a_cache_that_takes_no_files_is_none(small, cache, monkeypatch):
    cache.write_text("a file where the folder should be")
    for _ in range(2):
        assert built(small, monkeypatch)[1] == 1
