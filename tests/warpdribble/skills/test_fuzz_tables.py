"""Skills, mappings and model files at random: refused in one line by their own error, or sound."""

import numpy as np
import pytest

from warpdribble.assets import path as asset
from warpdribble.sims import Model, ModelError
from warpdribble.sims.retarget.mapping import MappingError, read_mapping
from warpdribble.skills.skill import SkillError, read_skill

VALUES = ("-1", "nan", "1e308", "9" * 30, "true", '""', "[]", "[[]]", "{}", "[1, 2, 3]", "2026-01-01", "0")


def changed(rng, data: bytes) -> bytes:
    """The file cut, overwritten, its lines shuffled, or values put in the place of others."""
    kind = rng.integers(0, 5)
    if kind == 0:
        return data[: rng.integers(0, len(data))]
    if kind == 1:
        data = bytearray(data)
        for _ in range(rng.integers(1, 8)):
            data[rng.integers(0, len(data))] = rng.integers(0, 256)
        return bytes(data)
    lines = data.split(b"\n")
    if kind == 2:
        return b"\n".join(lines[i] for i in rng.permutation(len(lines)))
    if kind == 3:
        return rng.bytes(int(rng.integers(0, 400)))
    for _ in range(rng.integers(1, 4)):
        k = rng.integers(0, len(lines))
        key, equals, _ = lines[k].partition(b"=")
        if equals:
            lines[k] = key + b"= " + VALUES[rng.integers(0, len(VALUES))].encode()
    return b"\n".join(lines)


def fuzz(read, error, source, path, cases: int, seed: int) -> int:
    """How many of the changed files are refused; anything but `error` in one line fails."""
    data, refused = source.read_bytes(), 0
    for case in range(cases):
        path.write_bytes(changed(np.random.default_rng([seed, case]), data))
        try:
            read(path)
        except error as reason:
            refused += 1
            assert "\n" not in str(reason), (case, str(reason))
            assert len(str(reason)) < 1500, case
    assert [p.name for p in path.parent.iterdir()] == [path.name]  # nothing was written
    return refused


TABLES = {
    "skill": (read_skill, SkillError, "skills/between-legs.toml", "broken.toml"),
    "authored skill": (read_skill, SkillError, "skills/waist.toml", "broken.toml"),
    "mapping": (read_mapping, MappingError, "mappings/mixamo.toml", "broken.toml"),
    "model": (Model.load, ModelError, "player.xml", "broken.xml"),
}


@pytest.mark.parametrize("kind", TABLES)
def test_broken_tables(tmp_path, kind):
    read, error, source, name = TABLES[kind]
    cases = 60 if kind == "model" else 300
    assert fuzz(read, error, asset(source), tmp_path / name, cases, seed=1) > cases // 4


@pytest.mark.slow
@pytest.mark.parametrize("kind", TABLES)
def test_many_broken_tables(tmp_path, kind):
    read, error, source, name = TABLES[kind]
    cases = 500 if kind == "model" else 3000
    assert fuzz(read, error, asset(source), tmp_path / name, cases, seed=2) > cases // 4
