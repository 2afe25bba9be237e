"""Bodies left out of a model: as if the file had never had them."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from warpdribble.sims import Model, ModelError, Simulation

FINGERS = ("*_mcp", "*_pip", "*_dip")


@pytest.fixture(scope="module")
def full():
    return Model.load("player")


@pytest.fixture(scope="module")
def alone():
    return Model.load("player", without=("ball",))


@pytest.fixture(scope="module")
def stiff():
    return Model.load("player", rigid=FINGERS, without=("ball",))


def load(xml, folder, **how):
    path = folder / "scene.xml"
    path.write_text(xml)
    return Model.load(path, **how)


def same(a, b):
    """Models of different files with the same parts."""
    assert (a.nq, a.nv, a.timestep) == (b.nq, b.nv, b.timestep)
    assert (a.body_names, a.joint_names, a.texts) == (b.body_names, b.joint_names, b.texts)
    assert a.tables.keys() == b.tables.keys()
    for name, rows in a.tables.items():
        np.testing.assert_array_equal(rows, b.tables[name], err_msg=name)
    for name in ("body_parent", "body_mass", "body_com", "body_inertia", "joint_link"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    assert [vars(s).keys() for s in a.shapes] == [vars(s).keys() for s in b.shapes]
    for one, two in zip(a.shapes, b.shapes, strict=True):
        for name, value in vars(one).items():
            np.testing.assert_array_equal(value, getattr(two, name), err_msg=f"{one.name} {name}")
    assert a.pairs == b.pairs
    assert a.sites.keys() == b.sites.keys()


def test_as_if_the_file_had_no_ball(full, alone, tmp_path):
    """The ball's element taken out of the text: the same tables, shapes, contacts and sites."""
    tree = ElementTree.parse(full.path)
    world = tree.find("worldbody")
    world.remove(next(body for body in world.findall("body") if body.get("name") == "ball"))
    tree.getroot().remove(tree.find("keyframe"))
    text = next(text for text in tree.iter("text") if text.get("name") == "ball")
    text.set("data", " ")
    never = load(ElementTree.tostring(tree.getroot(), encoding="unicode"), tmp_path)
    assert never.texts["ball"].split() == alone.texts["ball"].split() == []
    never.texts["ball"] = alone.texts["ball"]
    same(alone, never)


def test_51_degrees_of_freedom(stiff):
    """Six of the root, 45 of the joints (P1 3.3)."""
    assert (stiff.nv, stiff.nq) == (51, 65)
    assert sum(stiff.joint_type(name) == "ball" for name in stiff.joint_names) == 13
    assert sum(stiff.joint_type(name) == "hinge" for name in stiff.joint_names) == 6
    assert stiff.joint_names[0] == "root" and "ball" not in stiff.joint_names + stiff.body_names


def test_every_table_has_its_length(full, stiff):
    """Rows of links, dofs, bodies, shapes and slots as many as there are, and none that points elsewhere."""
    t, links = stiff.tables, len(stiff.joint_names) + 1
    count = {"link": links, "dof": stiff.nv, "body": stiff.nbody, "shape": len(stiff.shapes)}
    assert set(count) <= {name.split("_")[0] for name in t}
    for name, rows in t.items():
        what = name.split("_")[0]
        if what in count:
            assert len(rows) == count[what], name
    slots = len(t["slot_kind"])
    per_slot = [n for n in t if n.startswith("slot_")]
    assert all(len(t[name]) == slots for name in per_slot) and slots < len(full.tables["slot_kind"])
    assert t["link_parent"].max() < links and t["body_link"].max() < links
    assert t["slot_pair"].max() < len(stiff.pairs) == len(t["pair_erp"])
    shapes = [stiff.shapes[k] for pair in stiff.pairs for k in pair["shapes"]]
    assert {shape.name for shape in shapes}.isdisjoint({"ball"})
    assert len(t["flyer_link"]) == 0  # nothing is left that bounces


def test_mass_is_the_player_s(full, alone, stiff):
    ball = full.body_mass[full.body("ball")]
    assert alone.body_mass.sum() == pytest.approx(full.body_mass.sum() - ball, rel=1e-12)
    for model in (alone, stiff):
        assert model.tables["link_mass"].sum() == pytest.approx(alone.body_mass.sum(), rel=1e-12)


def test_no_body_is_named_a_ball(full, alone):
    assert full.named_bodies("ball") == {full.body("ball")}
    assert alone.named_bodies("ball") == set()
    for text in ("feet", "hands"):
        names = [{model.body_names[b] for b in model.named_bodies(text)} for model in (full, alone)]
        assert names[0] == names[1] != set()


def test_keyframes_fit(full, alone, stiff):
    """The same names and, joint by joint, the same coordinates."""
    for model in (alone, stiff):
        assert model.keyframes.keys() == full.keyframes.keys()
        for key, q in model.keyframes.items():
            assert q.shape == (model.nq,)
            for name in model.joint_names:
                expected = full.keyframes[key][full.q_slice(name)]
                np.testing.assert_array_equal(q[model.q_slice(name)], expected, err_msg=f"{key} {name}")
        np.testing.assert_array_equal(model.start_q, model.keyframes["start"])


@pytest.mark.parametrize("rigid", [(), FINGERS], ids=["", "stiff hands"])
def test_a_ball_far_away_changes_nothing(rigid):
    """Falling and pushed for half a second with contacts: the solver meets the same slots in the same order,
    so the bits are the same."""
    models = [Model.load("player", rigid=rigid, without=without) for without in ((), ("ball",))]
    full, alone = models
    random = np.random.default_rng(1)
    q, qd = np.tile(full.start_q, (4, 1)), 0.3 * random.standard_normal((4, full.nv))
    q[:, full.q_slice("ball").start :][:, :3] = [0.0, 0.0, 500.0]
    dofs = np.concatenate([np.r_[full.dof_slice(name)] for name in alone.joint_names])
    ends = []
    for model in models:
        sim = Simulation(model, 4)
        own = model.convert_q(full, q)
        sim.reset(joint_q=own, joint_qd=qd if model is full else qd[:, dofs])
        sim.set_targets(own)
        sim.apply_force("torso", [0.0, 60.0, 0.0])
        sim.step(50)
        ends.append((model.convert_q(full, sim.joint_q) if model is alone else sim.joint_q, sim))
    mine = alone.convert_q(full, ends[0][1].joint_q)
    assert np.abs(mine - alone.convert_q(full, q)).max() > 0.1
    np.testing.assert_array_equal(ends[1][1].joint_q, mine.astype(np.float32))
    np.testing.assert_array_equal(ends[1][1].joint_qd, ends[0][1].joint_qd[:, dofs])
    np.testing.assert_array_equal(ends[1][1].status, ends[0][1].status)


# ---------------------------------------------------------------------------------------- small files

SCENE = """<mujoco><size nuser_geom="3"/><worldbody><geom name="floor" type="plane" size="1 1 1"/>
<body name="a" pos="0 0 1"><freejoint name="fa"/><geom name="ga" size="0.1"/>
  <body name="tip" pos="0 0 1"><joint name="jt"/><geom name="gt" size="0.1"/><site name="top"/></body></body>
<body name="b" pos="3 0 1"><joint name="jb" type="ball"/><geom name="gb" size="0.1"/></body>
</worldbody>{}</mujoco>"""
KEY = '<keyframe><key name="k" qpos="1 2 3 1 0 0 0 0.5 0.6 0.8 0 0"/></keyframe>'


def test_all_that_hangs_on_a_body_goes_with_it(tmp_path):
    """Joints, shapes, sites, drives and exclusions."""
    rest = KEY + '<actuator><position joint="jt" kp="3" forcerange="-1 1"/></actuator>'
    rest += '<contact><exclude body1="a" body2="b"/></contact><custom><text name="t" data="a b"/></custom>'
    model = load(SCENE.format(rest), tmp_path, without=("a",))
    assert (model.body_names, model.joint_names, model.nv) == (["b"], ["jb"], 3)
    assert [shape.name for shape in model.shapes] == ["floor", "gb"]
    assert not model.sites and not model.tables["dof_kp"].any()
    assert model.named_bodies("t") == {0}
    np.testing.assert_allclose(model.keyframes["k"], [0.8, 0.0, 0.0, 0.6])


def test_the_other_one_left_out(tmp_path):
    model = load(SCENE.format(KEY), tmp_path, without=("b",))
    assert (model.body_names, model.joint_names) == (["a", "tip"], ["fa", "jt"])
    np.testing.assert_allclose(model.keyframes["k"], [1, 2, 3, 0, 0, 0, 1, 0.5])


@pytest.mark.parametrize("name", ["nobody", "l_hand", ""])
def test_a_body_that_is_not_at_the_top_is_refused(name):
    with pytest.raises(ModelError, match=rf"player\.xml: no body named '{name}' at the top level") as error:
        Model.load("player", without=("ball", name))
    assert "\n" not in str(error.value)


def test_left_out_twice_is_refused():
    with pytest.raises(ModelError, match="no body named 'ball' at the top level"):
        Model.load("player", without=("ball", "ball"))


def test_the_world_cannot_be_left_out():
    with pytest.raises(ModelError):
        Model.load("player", without=("world",))


def test_texts_lose_all_that_is_left_out(tmp_path):
    rest = '<custom><text name="hands" data="tip b"/></custom>'
    model = load(SCENE.format(rest), tmp_path, without=("a",))
    assert model.named_bodies("hands") == {model.body("b")}


def test_keyframes_of_joints_without_names(tmp_path):
    scene = SCENE.format(KEY)
    for name in ("fa", "jt", "jb"):
        scene = scene.replace(f' name="{name}"', "").replace(f'name="{name}" ', "")
    model = load(scene, tmp_path, without=("a",))
    np.testing.assert_allclose(model.keyframes["k"], [0.8, 0.0, 0.0, 0.6])
