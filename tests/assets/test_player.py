"""The player's MJCF against its tables, its own mirror image, and MuJoCo."""

import warnings
from itertools import pairwise

import mujoco
import numpy as np
import pytest

from warpdribble.assets import path, player

BALL_JOINTS = {"lower_back", "torso", "neck"} | {
    f"{s}_{j}" for s in "lr" for j in ("clavicle", "shoulder", "wrist", "hip", "ankle")
}
HINGES = {f"{s}_{j}" for s in "lr" for j in ("elbow", "knee", "toes")}
FINGERS = [f"{s}_{f}" for s in "lr" for f in player.FINGERS]
TREE = ["pelvis", "lower_back", "torso", "head"]
ARM = ["clavicle", "upper_arm", "lower_arm", "hand"]
ARM += [f"{f}_{i}" for f in ("thumb", "index", "middle", "ring", "pinky") for i in (1, 2, 3)]
LEG = ["upper_leg", "lower_leg", "foot", "toes"]
for limb in (ARM, LEG):
    TREE += [f"{s}_{name}" for s in "lr" for name in limb]


@pytest.fixture(scope="module")
def model():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return mujoco.MjSpec.from_file(str(path("player.xml"))).compile()


def at(model, key=None):
    """Data with kinematics at a keyframe, or in the zero pose."""
    data = mujoco.MjData(model)
    if key:
        mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
    mujoco.mj_forward(model, data)
    return data


def world_inertia(model, data, body):
    """Inertia of a body about its centre of mass, world axes [kg m^2]."""
    i = model.body(body).id
    r = data.ximat[i].reshape(3, 3)
    return r @ np.diag(model.body_inertia[i]) @ r.T


def extent(model, data, name):
    """Lowest and highest z of a geom [m]."""
    i = model.geom(name).id
    z, size, up = data.geom_xpos[i, 2], model.geom_size[i], data.geom_xmat[i].reshape(3, 3)[2]
    kind = model.geom_type[i]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        half = abs(up) @ size
    elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        half = abs(up[2]) * size[1] + size[0]
    else:
        half = size[0]
    return z - half, z + half


def player_geoms(model):
    return [model.geom(i).name for i in range(model.ngeom) if 0 < model.geom_bodyid[i] < 51]


def test_file_is_the_generated_one(tmp_path):
    written = player.write(tmp_path / "player.xml")
    assert written.read_bytes() == path("player.xml").read_bytes()


def test_topology(model):
    assert (model.nv, model.nq, model.nu) == (107, 132, 95)
    assert [model.body(i).name for i in range(1, model.nbody)] == [*TREE, "ball"]
    assert model.jnt_dofadr[model.joint("ball").id] == 101  # the player's 101 come first
    kinds = {mujoco.mjtJoint.mjJNT_BALL: set(), mujoco.mjtJoint.mjJNT_HINGE: set()}
    for j in range(model.njnt):
        kinds.setdefault(mujoco.mjtJoint(model.jnt_type[j]), set()).add(model.joint(j).name)
    assert kinds[mujoco.mjtJoint.mjJNT_BALL] == BALL_JOINTS | {f"{f}_mcp" for f in FINGERS}
    hinges = HINGES | {f"{f}_{j}" for f in FINGERS for j in ("pip", "dip")}
    assert kinds[mujoco.mjtJoint.mjJNT_HINGE] == hinges
    assert kinds[mujoco.mjtJoint.mjJNT_FREE] == {"root", "ball"}


def test_zero_pose_is_a_t_pose(model):
    data = at(model)
    assert np.all(model.body_quat == [1, 0, 0, 0])
    low, high = zip(*(extent(model, data, g) for g in player_geoms(model)), strict=True)
    assert max(high) == pytest.approx(1.80, abs=1e-5)
    assert min(low) == pytest.approx(0.0, abs=1e-5)
    assert data.site("head_top").xpos[2] == pytest.approx(1.80, abs=1e-5)
    for side, y in (("l", 1), ("r", -1)):
        shoulder, wrist = data.body(f"{side}_upper_arm").xpos, data.body(f"{side}_hand").xpos
        arm = wrist - shoulder
        assert np.allclose(arm / np.linalg.norm(arm), [0, y, 0], atol=1e-6)
        assert np.allclose(data.site(f"{side}_palm").xmat.reshape(3, 3)[:, 2], [0, 0, -1])
        assert data.site(f"{side}_thumb_tip").xpos[0] > data.site(f"{side}_index_tip").xpos[0]


def test_mass(model):
    assert model.body_subtreemass[1] == pytest.approx(76.0, abs=1e-6)
    fraction = lambda *names: sum(model.body(n).mass[0] for n in names) / 76.0 * 100  # noqa: E731
    table = {  # de Leva 1996, table 4, men [%]
        "head": (6.94, ["head"]),
        "trunk": (43.46, ["pelvis", "lower_back", "torso", "l_clavicle", "r_clavicle"]),
        "upper arm": (2.71, ["l_upper_arm"]),
        "forearm": (1.62, ["l_lower_arm"]),
        "hand": (0.61, ["l_hand", *(n for n in TREE if n.startswith("l_") and n[-1] in "123")]),
        "thigh": (14.16, ["l_upper_leg"]),
        "shank": (4.33, ["l_lower_leg"]),
        "foot": (1.37, ["l_foot", "l_toes"]),
    }
    for segment, (percent, names) in table.items():
        assert fraction(*names) == pytest.approx(percent, abs=1e-4), segment


@pytest.mark.parametrize(
    ("body", "length", "gyration", "long_axis"),
    [  # de Leva 1996, table 4, men: radii of gyration about two cross axes [% of length]
        ("l_upper_arm", 0.2817, (28.5, 26.9), 1),
        ("l_lower_arm", 0.2689, (27.6, 26.5), 1),
        ("l_upper_leg", 0.4222, (32.9, 32.9), 2),
        ("l_lower_leg", 0.4403, (25.1, 24.6), 2),
    ],
)
def test_limb_inertia_is_near_the_published_one(model, body, length, gyration, long_axis):
    inertia = np.diag(world_inertia(model, at(model), body))
    ours = np.sqrt(np.delete(inertia, long_axis) / model.body(body).mass) / (length * 1.8 / 1.741)
    assert ours == pytest.approx(np.array(gyration) / 100, rel=0.35)


def test_inertias_are_physical(model):
    a, b, c = model.body_inertia[1:].T
    assert np.all(model.body_inertia[1:] > 0)
    assert np.all(a + b >= c) and np.all(b + c >= a) and np.all(a + c >= b)


def test_ball(model):
    ball = model.body("ball")
    shell = 2 / 3 * 0.6237 * 0.1193**2
    assert ball.mass[0] == pytest.approx(0.6237)
    assert ball.inertia == pytest.approx([shell] * 3, rel=1e-6)
    assert model.geom("ball").size[0] == pytest.approx(0.1193)
    assert ball.pos[2] == pytest.approx(0.1193)
    assert np.hypot(*ball.pos[:2]) == pytest.approx(0.5, abs=0.01)
    assert ball.pos[0] > 0 > ball.pos[1]


def test_right_mirrors_left(model):
    data = at(model, "start")
    y, pseudo = np.array([1, -1, 1]), np.array([-1, 1, -1])
    for name in [n for n in TREE if n.startswith("l_")]:
        left, right = model.body(name), model.body("r" + name[1:])
        assert left.mass == pytest.approx(right.mass, rel=1e-9)
        for x in ("xpos", "xipos"):
            mirrored = getattr(data.body(right.name), x) * y
            assert getattr(data.body(name), x) == pytest.approx(mirrored, abs=1e-7)
        mirrored = world_inertia(model, data, right.name) * np.outer(y, y)
        scale = abs(mirrored).max()
        assert world_inertia(model, data, name) == pytest.approx(mirrored, abs=1e-5 * scale)
        i, j = left.jntadr[0], right.jntadr[0]
        assert np.all(model.jnt_range[i] == model.jnt_range[j])
        assert model.dof_armature[left.dofadr[0]] == model.dof_armature[right.dofadr[0]]
        if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE:
            assert model.jnt_axis[i] == pytest.approx(model.jnt_axis[j] * pseudo, abs=1e-9)
    for i in range(model.nu):
        name = model.actuator(i).name
        if name.startswith("l_"):
            j = model.actuator("r" + name[1:]).id
            for gains in (model.actuator_gainprm, model.actuator_biasprm):
                assert np.all(gains[i] == gains[j])
            assert np.all(model.actuator_forcerange[i] == model.actuator_forcerange[j])


def test_every_joint_has_its_drives(model):
    driven = np.zeros(model.nv)
    for i in range(model.nu):
        joint = model.actuator_trnid[i, 0]
        gear = model.actuator_gear[i, :3]
        name, (_, kp, kv) = model.actuator(i).name, -model.actuator_biasprm[i, :3]
        assert kp == model.actuator_gainprm[i, 0] > 0 and kv > 0
        low, high = model.actuator_forcerange[i]
        assert -low == high > 0
        start = model.jnt_dofadr[joint]
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE:
            assert name == model.joint(joint).name
            driven[start] += 1
        else:
            assert name == f"{model.joint(joint).name}_{'xyz'[gear.argmax()]}"
            driven[start : start + 3] += gear
    assert np.all(driven[6:101] == 1) and not driven[:6].any() and not driven[101:].any()
    assert np.all(model.dof_armature[6:101] > 0)


def test_ankles_carry_the_stand(model):
    """Legs and back are springs in series under an inverted pendulum: the chain must be stable."""
    data = at(model, "start")
    kp = lambda name: model.actuator_gainprm[model.actuator(name).id, 0]  # noqa: E731
    ankle = data.body("l_foot").xpos[2]
    weight = 76.0 * 9.81 * (data.subtree_com[1][2] - ankle)
    assert kp("l_ankle_y") > weight / 2
    # angles from the vertical of shanks, thighs, pelvis, lower back and torso; each falls with the
    # moment of all that it carries about its lower joint
    links = ["lower_leg", "upper_leg", "pelvis", "lower_back", "torso"]
    joints = [data.body(n).xpos[2] for n in ("l_foot", "l_lower_leg", *links[2:])]
    fall = np.zeros(5)
    carried = {"lower_leg": 0, "upper_leg": 1, "pelvis": 2, "lower_back": 3}
    for i in range(1, 51):
        name = model.body(i).name
        k = carried.get(name.removeprefix("l_").removeprefix("r_"), 4)
        if name[2:] in ("foot", "toes"):
            continue
        heights = [*joints[: k + 1], data.xipos[i, 2]]
        fall[: k + 1] += model.body_mass[i] * 9.81 * np.diff(heights)
    assert fall.sum() == pytest.approx(weight, rel=0.01)
    bend = np.eye(5) - np.eye(5, k=-1)
    springs = [2 * kp("l_ankle_y"), 2 * kp("l_knee"), 2 * kp("l_hip_y"), kp("lower_back_y"),
               kp("torso_y")]  # fmt: skip
    stiffness = bend.T @ np.diag(springs) @ bend - np.diag(fall)
    assert np.linalg.eigvalsh(stiffness)[0] > 10.0


def test_collisions_are_with_the_ground_and_the_ball_only(model):
    touch = lambda a, b: bool(  # noqa: E731
        model.geom(a).contype & model.geom(b).conaffinity or model.geom(b).contype & model.geom(a).conaffinity
    )
    geoms = player_geoms(model)
    assert all(touch("ground", g) and touch("ball", g) for g in geoms)
    assert touch("ground", "ball") and not touch(geoms[0], geoms[5])
    kinds = {mujoco.mjtGeom(t).name[7:] for t in model.geom_type}
    assert kinds == {"PLANE", "SPHERE", "CAPSULE", "BOX"}
    assert np.all(model.geom_condim == 3)
    assert model.geom_user[model.geom("ground").id, 0] == 1.0
    assert model.geom_user[model.geom("ball").id, 0] == 0.8


@pytest.mark.parametrize("key", ["start", "flat", "ready", "fist"])
def test_keyframes_stand_on_the_ground(model, key):
    data = at(model, key)
    for side in "lr":
        for part in ("foot", "toes"):
            assert extent(model, data, f"{side}_{part}")[0] == pytest.approx(0, abs=1e-3)
            up = data.geom(f"{side}_{part}").xmat.reshape(3, 3)[2]
            assert np.sort(abs(up)) == pytest.approx([0, 0, 1], abs=1e-6)  # flat
    for j in range(model.njnt):
        a = model.jnt_qposadr[j]
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_BALL:
            assert np.linalg.norm(model.key(key).qpos[a : a + 4]) == pytest.approx(1, abs=1e-8)
        if model.jnt_limited[j] and model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE:
            low, high = model.jnt_range[j]
            assert low <= data.qpos[a] <= high
    # drives at rest: the targets are the pose
    assert data.actuator_length == pytest.approx(model.key(key).ctrl, abs=1e-6)
    assert data.body("l_hand").xpos[2] < 1.0  # arms hang
    palm = data.site("l_palm").xmat.reshape(3, 3)[:, 2]
    assert palm @ [0, -1, 0] > 0.9  # palms face the thighs


def test_hands_close_from_flat_to_fist(model):
    flat, ready, fist = (at(model, key) for key in ("flat", "ready", "fist"))
    for finger in FINGERS:
        reach = [
            np.linalg.norm(d.site(f"{finger}_tip").xpos - d.site(f"{finger[0]}_palm").xpos)
            for d in (flat, ready, fist)
        ]
        assert reach[0] > reach[1] > reach[2]
        assert reach[2] < 0.07
        bones = [flat.body(f"{finger}_{i}").xpos for i in (1, 2, 3)]
        a, b = bones[1] - bones[0], bones[2] - bones[1]
        assert a @ b == pytest.approx(np.linalg.norm(a) * np.linalg.norm(b), rel=1e-6)  # straight


@pytest.mark.parametrize("side", "lr")
def test_a_hand_at_rest_curls_more_toward_the_little_finger(model, side):
    """Angles between the bones, read off their places: a cascade, as measured of hands at rest."""
    data = at(model, "start")
    palm = data.body(f"{side}_middle_1").xpos - data.body(f"{side}_hand").xpos
    bones = {}
    for finger in ("index", "middle", "ring", "pinky"):
        a, b, c = (data.body(f"{side}_{finger}_{i}").xpos for i in (1, 2, 3))
        bones[finger] = [palm, b - a, c - b, data.site(f"{side}_{finger}_tip").xpos - c]
    unit = {finger: [x / np.linalg.norm(x) for x in four] for finger, four in bones.items()}
    bends = {f: [np.degrees(np.arccos(a @ b)) for a, b in pairwise(x[:-1])] for f, x in unit.items()}
    knuckle, middle = np.array(list(bends.values())).T
    assert np.all(np.diff(knuckle) > 2.0) and knuckle[0] > 25.0 and knuckle[-1] < 45.0
    assert np.all(np.diff(middle) > 2.0) and middle[0] > 35.0 and middle[-1] < 50.0


@pytest.mark.parametrize("side", "lr")
def test_fingers_at_rest_lie_side_by_side(model, side):
    """Neighbouring middle bones: nearer than in the flat hand, a finger's thickness apart at the least."""
    rest, flat = (at(model, key) for key in ("start", "flat"))
    for one, two in zip(("index", "middle", "ring"), ("middle", "ring", "pinky")):
        across = [
            abs((d.body(f"{side}_{one}_3").xpos - d.body(f"{side}_{two}_3").xpos)
                @ d.body(f"{side}_hand").xmat.reshape(3, 3)[:, 0])
            for d in (rest, flat)
        ]  # fmt: skip
        assert 2 * player.FINGER_RADIUS < across[0] < 0.023 < across[1], (one, across)


@pytest.mark.parametrize(
    ("joint", "point", "direction"),
    [
        ("elbow", "hand", (1, 0, 0)),
        ("knee", "foot", (-1, 0, 0)),
        ("index_pip", "index_tip", (0, 0, -1)),
        ("pinky_dip", "pinky_tip", (0, 0, -1)),
    ],
)
def test_positive_angles_flex_both_sides(model, joint, point, direction):
    for side in "lr":
        data = at(model)
        find = data.site if point.endswith("tip") else data.body
        before = find(f"{side}_{point}").xpos.copy()
        data.joint(f"{side}_{joint}").qpos[:] = 0.3
        mujoco.mj_kinematics(model, data)
        moved = find(f"{side}_{point}").xpos - before
        assert moved @ direction > 0.7 * np.linalg.norm(moved) > 0


@pytest.mark.parametrize("integrator", ["IMPLICITFAST", "DISCRETE"])
def test_start_stands(model, integrator):
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    data = at(model, "start")
    height = data.body("head").xpos[2]
    for _ in range(200):
        mujoco.mj_step(model, data)
    assert data.body("head").xpos[2] == pytest.approx(height, abs=0.01)
    assert np.linalg.norm(data.subtree_com[1][:2]) < 0.05
    assert abs(data.qvel[:101]).max() < 0.2
    assert not any(data.warning.number)
