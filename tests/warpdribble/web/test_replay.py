import base64
import json
import os
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from warpdribble.assets import path as asset
from warpdribble.skin import skin
from warpdribble.takes.take import Take, TakeError
from warpdribble.web import page as replay
from warpdribble.web.page import write_replay

KINDS = {"f4": np.float32, "u4": np.uint32, "u2": np.uint16, "i2": np.int16, "i1": np.int8, "u1": np.uint8}


def read_back(path):
    """What a page says, and a function that gives its arrays."""
    text = path.read_text(encoding="utf-8")
    said = json.loads(re.search(r'<script id="take"[^>]*>(.*?)</script>', text, re.S).group(1))
    data = re.search(r'<script id="data"[^>]*>(.*?)</script>', text, re.S).group(1)
    block = base64.b64decode(data)
    return said, lambda a: np.frombuffer(block, KINDS[a["kind"]], a["count"], a["at"]).astype(float)


def places(said, array):
    motion = said["motion"]
    packed = array(motion["places"]).reshape(said["worlds"], said["frames"], said["bodies"], 3)
    return np.array(motion["low"]) + packed / 65535 * np.array(motion["size"])


def test_motion_reads_back(dribble_take, tmp_path):
    said, array = read_back(write_replay(tmp_path / "take.html", dribble_take))
    assert np.abs(places(said, array)[0] - dribble_take.body_q[..., :3]).max() < 1e-4
    turns = array(said["motion"]["turns"]).reshape(dribble_take.body_q[..., 3:].shape) / 32767
    assert np.abs(np.abs(np.sum(turns * dribble_take.body_q[..., 3:], axis=-1)) - 1.0).max() < 1e-4
    assert said["fps"] == 50.0 and said["frames"] == 36


def test_nothing_is_fetched(dribble_take, tmp_path):
    text = write_replay(tmp_path / "take.html", dribble_take).read_text()
    outside = re.sub(r"<script>.*?</script>", "", text, count=1, flags=re.S)  # three.js names its own pages
    assert not re.search(r"(src|href)\s*=|https?://|import\s*\(|fetch\s*\(", outside)
    assert "three.js authors" in text and "@THREE@" not in text and "@DATA@" not in text
    assert "Permission is hereby granted" in asset("replay/three.LICENSE").read_text()


def test_titles_and_names_stay_text(dribble_take, tmp_path):
    title = '</script><script>alert("x")</script> @DATA@ <b>'
    contacts = {"</script>": np.arange(36) % 9 < 3}
    path = write_replay(tmp_path / "take.html", dribble_take, contacts, title)
    said, _ = read_back(path)
    assert said["title"] == title and list(said["contacts"]) == ["</script>"]
    assert path.read_text().count("</script>") == 4


def test_contacts_become_spans(dribble_take, tmp_path):
    on = np.zeros(36, bool)
    on[[0, 1, 10, 35]] = True
    said, _ = read_back(write_replay(tmp_path / "take.html", dribble_take, {"x": on}))
    assert said["contacts"]["x"] == [[0.0, 0.04], [0.2, 0.22], [0.7, 0.72]]


def test_the_skin_comes_along(dribble_take, shipped_player, tmp_path):
    said, array = read_back(write_replay(tmp_path / "take.html", dribble_take, skin=True))
    built = skin.of(shipped_player)
    inverse = np.array(said["skin"]["inverse"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    bodies = {m["body"] for m in said["meshes"]}
    assert bodies == {-1, shipped_player.body("ball")}
    assert sum(array(p["faces"]).size for p in said["skin"]["parts"]) == built.mesh.faces.size
    part = said["skin"]["parts"][built.regions.index("hair")]
    points = np.array(part["low"]) + array(part["points"]).reshape(-1, 3) / 65535 * np.array(part["size"])
    used = np.unique(built.mesh.faces[built.region == built.regions.index("hair")])
    assert np.abs(points - built.mesh.points[used]).max() < 1e-5
    weights = array(part["weights"]).reshape(-1, 4)
    assert np.all(weights.sum(axis=1) == 255)
    head = shipped_player.body("head")
    moved = points @ inverse[head, :3, :3].T + inverse[head, :3, 3]
    assert np.linalg.norm(moved, axis=1).max() < 0.3


def test_worlds_are_shown_up_to_a_number(dribble_take, tmp_path):
    take = Take.of(dribble_take.model, np.stack([dribble_take.body_q[:2]] * 70), 50.0)
    said, array = read_back(write_replay(tmp_path / "take.html", take))
    assert said["worlds"] == replay.MOST_WORLDS == len(said["offsets"])
    assert places(said, array).shape[0] == replay.MOST_WORLDS


def test_a_reference_goes_along_as_a_ghost_and_costs_little(dribble_take, tmp_path):
    """25 poses a second of all bodies but fingers, within a millimetre; fingers go with their hand."""
    wanted = dribble_take.body_q.copy()
    wanted[..., :2] += [0.3, -0.2]
    take = replace(dribble_take, reference=wanted)
    said, array = read_back(write_replay(tmp_path / "take.html", take))
    ghost, model = said["ghost"], take.model
    assert ghost["fps"] == 25.0 and ghost["frames"] == 18
    names = [model.body_names[b] for b in ghost["bodies"]]
    assert {"pelvis", "head", "l_foot", "r_hand", "ball"} <= set(names)
    shape = (ghost["frames"], len(names))
    packed = array(ghost["places"]).reshape(*shape, 3)
    found = np.array(ghost["low"]) + packed / 65535 * np.array(ghost["size"])
    assert np.abs(found - wanted[::2, ghost["bodies"], :3]).max() < 1e-4
    turns = array(ghost["turns"]).reshape(*shape, 4) / 32767
    assert np.abs(np.abs(np.sum(turns * wanted[::2, ghost["bodies"], 3:], axis=-1)) - 1.0).max() < 1e-4
    carriers = [names[c] for c in ghost["carriers"]]
    for body, carrier in zip(model.body_names, carriers):
        own = body in names
        assert carrier == body if own else model.body(body) in model.descendants(model.body(carrier))
    light = [c for b, c in zip(model.body_names, carriers) if b not in names]
    assert sorted(light) == ["l_hand"] * 15 + ["r_hand"] * 15
    motion = sum(said["motion"][part]["count"] for part in ("places", "turns"))
    assert sum(ghost[part]["count"] for part in ("places", "turns")) < 0.25 * motion


def test_without_a_reference_or_with_many_worlds_there_is_no_ghost(dribble_take, tmp_path):
    said, _ = read_back(write_replay(tmp_path / "take.html", dribble_take))
    assert said["ghost"] is None
    both = np.stack([dribble_take.body_q] * 2)
    take = Take.of(dribble_take.model, both, 50.0, reference=both)
    said, _ = read_back(write_replay(tmp_path / "take.html", take))
    assert said["ghost"] is None


def test_a_reference_has_a_pose_for_every_frame(dribble_take):
    with pytest.raises(ValueError, match=r"reference is \(35, 51, 7\), should be as body_q, \(36, 51, 7\)"):
        replace(dribble_take, reference=dribble_take.body_q[:-1])


def test_only_html_is_written(dribble_take, tmp_path):
    with pytest.raises(TakeError, match=r"\.html"):
        write_replay(tmp_path / "take.txt", dribble_take)
    assert list(tmp_path.iterdir()) == []


def photographed(browser, folder, address):
    """What a browser shows of a page (height, width, 3); one that is busy is given more time to draw."""
    from matplotlib.image import imread

    for budget in (2000, 6000, 18000):
        command = [
            browser, "--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader", f"--user-data-dir={folder / 'profile'}", "--window-size=640,480",
            f"--virtual-time-budget={budget}", "--enable-logging=stderr",
            f"--screenshot={folder / 'shot.png'}", address,
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)
        assert "Uncaught" not in done.stderr, done.stderr[-2000:]
        picture = imread(folder / "shot.png")[..., :3]
        if picture[60:380].std(axis=(0, 1)).max() > 0.01:
            return picture
    raise AssertionError(f"nothing is drawn of {address}")


@pytest.mark.slow
@pytest.mark.parametrize("with_skin", [False, True])
def test_a_browser_shows_the_player_moving(dribble_take, tmp_path, with_skin):
    browser = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    if not browser:
        pytest.skip("no Chromium")
    wanted = dribble_take.body_q.copy()
    wanted[..., 1:3] += [0.5, 0.1]
    take = replace(dribble_take, reference=wanted)
    page = write_replay(tmp_path / "take.html", take, {"x": np.arange(36) > 9}, skin=with_skin)
    addresses = ("#t=0", "#t=0.35", "", "#t=0&ghost", "#t=0&ghost=here", "#t=0&view=above")
    pictures = [photographed(browser, tmp_path, page.as_uri() + said) for said in addresses]
    first, second, played, ghost, over, above = pictures
    upper = first[60:380]
    red, orange = (upper[..., 0] > 1.6 * upper[..., 1]), (upper[..., 0] > 2.2 * upper[..., 2])
    assert red.mean() > 0.005 and orange.mean() > 0.01
    assert np.mean(np.abs(first - second).max(axis=-1) > 0.15) > 0.005
    assert np.mean(np.abs(first - played).max(axis=-1) > 0.15) > 0.005
    for other in (ghost, over, above):
        assert np.mean(np.abs(upper - other[60:380]).max(axis=-1) > 0.1) > 0.005
    for other in (ghost, over):  # what they add is bluer than what was there
        changed = np.abs(upper - other[60:380]).max(axis=-1) > 0.1
        bluer = (other[60:380] - upper)[changed]
        assert np.mean(bluer[:, 2] - bluer[:, 0]) > 0.05
