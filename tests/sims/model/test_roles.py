"""Which body plays which part: told by the file and its tree, whatever the names are."""

import dataclasses

import pytest

from warpdribble.sims import Model, ModelError
from warpdribble.sims.model import roles

WALKER = """
<mujoco><worldbody>
<body name="hull" pos="0 0 1"><freejoint name="drift"/><geom size="0.1"/>
  <body name="chest" pos="0 0 .2"><joint name="waist" type="ball"/><geom size="0.1"/>
    <body name="skull" pos="0 0 .3"><joint name="nape" type="ball"/><geom size="0.1"/></body>
    {arms}
  </body>
  {legs}
</body>
<body name="prop" pos="1 0 1"><freejoint name="loose"/><geom size="0.1"/></body>
</worldbody><custom>{texts}</custom></mujoco>"""
LIMB = """
<body name="{n}1" pos="0 {y} 0"><joint name="{n}a" type="ball"/><geom size="0.05"/>
  <body name="{n}2" pos="0 0 -.3"><joint name="{n}b" type="{middle}"/><geom size="0.05"/>
    <body name="{n}3" pos="0 0 -.3"><joint name="{n}c" type="ball"/><geom size="0.05"/>
      <site name="{n}p"/>
      <body name="{n}4" pos=".1 0 0"><joint name="{n}d" type="hinge"/><geom size="0.05"/></body>
    </body></body></body>"""
TEXTS = {
    "ball": "prop",
    "trunk": "chest",
    "head": "skull",
    "hands": "u3 u4 v3 v4",
    "palms": "up vp",
    "feet": "x3 x4 y3 y4",
}


@pytest.fixture
def load(tmp_path):
    def loaded(texts, middle="hinge", **how):
        arms, legs = (
            "".join(LIMB.format(n=n, y=y, middle=middle) for n, y in zip(names, (0.2, -0.2)))
            for names in ("uv", "xy")
        )
        said = "".join(f'<text name="{name}" data="{data}"/>' for name, data in texts.items())
        path = tmp_path / "walker.xml"
        path.write_text(WALKER.format(arms=arms, legs=legs, texts=said))
        return Model.load(path, **how)

    return loaded


def test_names_do_not_matter(load):
    found = load(TEXTS).roles
    assert (found.root, found.root_body) == ("drift", "hull")
    assert (found.ball, found.ball_joint, found.trunk, found.head) == ("prop", "loose", "chest", "skull")
    assert (found.hands, found.feet, found.palms) == (("u3", "v3"), ("x3", "y3"), ("up", "vp"))
    assert found.spine == ("waist", "nape")
    assert (found.shoulders, found.elbows, found.wrists) == (("ua", "va"), ("ub", "vb"), ("uc", "vc"))
    assert (found.hips, found.knees, found.ankles) == (("xa", "ya"), ("xb", "yb"), ("xc", "yc"))
    assert found.toes == ("xd", "yd")


def test_the_file_s_order_is_kept(load):
    found = load(TEXTS | {"feet": "y3 y4 x3 x4"}).roles
    assert (found.feet, found.knees, found.toes) == (("y3", "x3"), ("yb", "xb"), ("yd", "xd"))


def test_a_limb_without_a_hinge_has_no_joints_by_role(load):
    found = load(TEXTS, middle="ball").roles
    assert found.feet == ("x3", "y3") and found.toes == ("xd", "yd")
    assert found.hips == found.knees == found.ankles == ()


def test_without_texts_nothing_but_the_root_is_known(load):
    found = dataclasses.asdict(load({}).roles)
    assert (found.pop("root"), found.pop("root_body")) == ("drift", "hull")
    del found["file"]
    assert set(map(bool, found.values())) == {False}


@pytest.mark.parametrize("role", [f.name for f in dataclasses.fields(roles.Roles) if f.name != "file"])
def test_what_is_missing_is_said_in_one_line_by_name(load, tmp_path, role):
    """One message for each role, which says what the file should have."""
    found = dataclasses.replace(load({}).roles, root=None, root_body=None)
    ask = found.one if getattr(found, role) is None else found.both
    with pytest.raises(ModelError) as error:
        ask(role)
    said = str(error.value)
    assert said.startswith(f"{tmp_path / 'walker.xml'}: the model has no {role.replace('_', ' ')}: ")
    assert "\n" not in said and len(said) > 60


def test_one_hand_is_no_pair(load):
    found = load(TEXTS | {"hands": "u3 u4"}).roles
    assert found.hands == ("u3",) and found.one("head") == "skull" and found.both("feet") == ("x3", "y3")
    with pytest.raises(ModelError, match=r"no hands: .* must list the bodies of two hands"):
        found.both("hands")


@pytest.mark.parametrize("text", ["feet", "hands", "ball", "trunk", "head", "knuckles"])
def test_a_name_of_no_body_is_refused(load, text):
    with pytest.raises(ModelError, match=rf"walker.xml: .*{text}.* names no body: 'u9'"):
        load(TEXTS | {text: "u3 u9"}).roles  # noqa: B018


def test_a_body_left_out_plays_no_part(load):
    found = load(TEXTS, without=("prop",)).roles
    assert found.ball is found.ball_joint is None and found.hands == ("u3", "v3")


def test_a_first_joint_that_is_not_free_is_no_root(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text('<mujoco><worldbody><body><joint/><geom size="0.1"/></body></worldbody></mujoco>')
    with pytest.raises(ModelError, match="no root: its first joint must be a free one"):
        Model.load(path).roles.one("root")


def test_the_player_s():
    """The shipped file says all of it; the left ones come first."""
    found = Model.load("player").roles
    assert all(bool(value) for value in dataclasses.asdict(found).values())
    assert (found.root_body, found.trunk, found.head, found.ball) == ("pelvis", "torso", "head", "ball")
    assert found.spine == ("lower_back", "torso", "neck")
    singular = {"feet": "foot", "toes": "toes"}
    limbs = ("shoulders", "elbows", "wrists", "hips", "knees", "ankles")
    for role in ("hands", "palms", "feet", *limbs, "toes"):
        name = singular.get(role, role.removesuffix("s"))
        assert found.both(role) == (f"l_{name}", f"r_{name}")
    for hand, fingers in zip(found.hands, found.knuckles):
        assert fingers == tuple(f"{hand[:2]}{finger}_1" for finger in ("index", "middle", "pinky"))
