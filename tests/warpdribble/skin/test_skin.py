import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from warpdribble.sims import Model
from warpdribble.sims.model import pose
from warpdribble.skin import clothes, flesh, skin
from warpdribble.skin.cut import onto
from warpdribble.skin.implicit import Union
from warpdribble.skin.surface_net import edges, surface_net


@pytest.fixture(scope="module")
def built(shipped_player):
    return skin.of(shipped_player)


def solid(points, faces):
    return trimesh.Trimesh(points, faces, process=False)


def test_it_is_one_closed_surface_of_a_persons_size(built):
    body = solid(built.mesh.points, built.mesh.faces)
    assert body.is_watertight and body.is_winding_consistent
    assert len(body.split(only_watertight=False)) == 1
    assert 0.060 < body.volume < 0.085  # 76 kg of 985 kg/m^3 are 0.077
    low, high = body.bounds
    assert low[2] == pytest.approx(0.0, abs=0.006) and high[2] == pytest.approx(1.80, abs=0.02)
    shown = built.mesh.normals[built.mesh.faces].mean(axis=1)
    assert np.mean(np.sum(shown * body.face_normals, axis=1) > 0.0) > 0.998


def test_left_and_right_are_alike(built):
    left = built.mesh.points[built.mesh.points[:, 1] > 0.01]
    right = built.mesh.points[built.mesh.points[:, 1] < -0.01] * [1.0, -1.0, 1.0]
    from scipy.spatial import cKDTree

    assert np.percentile(cKDTree(left).query(right)[0], 99) < 0.006


def test_weights_add_up_and_follow_the_nearest_body(built, shipped_player):
    assert np.allclose(built.weights.sum(axis=1), 1.0)
    assert np.all(built.weights >= 0.0) and np.all(np.diff(built.weights, axis=1) < 1.5 / skin.WEIGHT_STEPS)
    shares = skin.WEIGHT_STEPS * built.weights
    assert np.allclose(shares, np.round(shares), atol=1e-9)
    for name in ("l_middle_3", "r_thumb_2", "head", "l_foot", "pelvis"):
        body = shipped_player.body(name)
        mine = (built.bodies[:, 0] == body) & (built.weights[:, 0] > 0.6)
        assert mine.sum() > 10
        apart = np.linalg.norm(built.mesh.points[mine] - built.bind_q[body, :3], axis=1)
        assert apart.max() < 0.35
    ball = shipped_player.body("ball")
    assert not np.any(built.weights[built.bodies == ball])


def test_weights_are_smooth_along_the_surface(built, shipped_player):
    dense = np.zeros((len(built.weights), shipped_player.nbody))
    np.put_along_axis(dense, built.bodies, built.weights, axis=1)
    pairs, _ = edges(built.mesh.faces)
    steps = np.abs(dense[pairs[:, 0]] - dense[pairs[:, 1]]).max(axis=1)
    assert np.percentile(steps, 99.9) < 0.30


def test_neighbouring_fingers_do_not_pull_each_other(built, shipped_player):
    index, ring = (shipped_player.body(f"l_{f}_3") for f in ("index", "ring"))
    dense = np.zeros((len(built.weights), shipped_player.nbody))
    np.put_along_axis(dense, built.bodies, built.weights, axis=1)
    assert not np.any((dense[:, index] > 0.01) & (dense[:, ring] > 0.01))


def test_a_turn_of_everything_turns_the_skin(built):
    turn = Rotation.from_rotvec([0.2, -0.5, 1.0])
    moved = built.bind_q.copy()
    moved[:, :3] = turn.apply(moved[:, :3]) + [1.0, 2.0, 3.0]
    moved[:, 3:] = (turn * Rotation.from_quat(moved[:, 3:])).as_quat()
    assert np.allclose(built.posed(moved), turn.apply(built.mesh.points) + [1.0, 2.0, 3.0], atol=1e-9)


def test_a_bent_arm_keeps_its_thickness(built, shipped_player):
    """With the elbow at 90 degrees, skin of the forearm is as far from its bone as before, within a third."""
    joint_q = np.array(shipped_player.start_q)
    joint_q[shipped_player.q_slice("l_elbow")] = np.radians(90.0)
    body_q = pose.forward(shipped_player, joint_q[None])[0]
    lower = shipped_player.body("l_lower_arm")
    mine = np.flatnonzero(built.bodies[:, 0] == lower)

    def thickness(points, q):
        local = Rotation.from_quat(q[3:]).inv().apply(points[mine] - q[:3])
        along = (local[:, 1] > 0.06) & (local[:, 1] < 0.22)
        return np.linalg.norm(local[along][:, [0, 2]], axis=1)

    before = thickness(built.mesh.points, built.bind_q[lower])
    after = thickness(built.posed(body_q), body_q[lower])
    assert np.median(after) == pytest.approx(np.median(before), rel=0.1)
    assert after.min() > 0.66 * before.min()


POSES = {
    "raised": {"l_shoulder": (80, 0, 0), "r_shoulder": (-80, 0, 0), "l_elbow": 0, "r_elbow": 0},
    "to the side": {"l_shoulder": (0, 0, 0), "r_shoulder": (0, 0, 0)},
    "forward": {"l_shoulder": (0, 0, -85), "r_shoulder": (0, 0, 85)},
    "hanging": {"l_shoulder": (-75, 0, 0), "r_shoulder": (75, 0, 0)},
    "running": {"l_hip": (0, -60, 0), "l_knee": 80, "r_hip": (0, 25, 0), "r_knee": 40},
}


@pytest.mark.parametrize("name", POSES)
def test_no_pose_turns_the_skin_inside_out(built, shipped_player, name):
    """Less than a square centimetre of its faces, of two square metres, looks the other way than its bodies
    carry their normals, six with the hollows of bent knees; and it goes on to hold what it holds."""
    joint_q = np.array(shipped_player.start_q, float)
    for joint, turn in POSES[name].items():
        ball = shipped_player.joint_type(joint) == "ball"
        angle = np.radians(turn)
        joint_q[shipped_player.q_slice(joint)] = Rotation.from_rotvec(angle).as_quat() if ball else angle
    body_q = pose.forward(shipped_player, joint_q[None])[0]
    turns = (Rotation.from_quat(body_q[:, 3:]) * Rotation.from_quat(built.bind_q[:, 3:]).inv()).as_matrix()
    carried = np.einsum("pk,pkij,pj->pi", built.weights, turns[built.bodies], built.mesh.normals)
    body = solid(built.posed(body_q), built.mesh.faces)
    outward = np.sum(body.face_normals * carried[built.mesh.faces].mean(axis=1), axis=1) > 0.0
    assert 1.5 < body.area < 2.3 and body.area_faces[~outward].sum() < (6e-4 if name == "running" else 1e-4)
    assert body.volume == pytest.approx(solid(built.mesh.points, built.mesh.faces).volume, rel=0.06)


def border(built, a, b):
    """Points (n, 3) between two regions."""
    ends = (built.mesh.faces[built.region == built.regions.index(r)] for r in (a, b))
    return built.mesh.points[np.intersect1d(*(np.unique(e) for e in ends))]


def test_regions_cover_the_body(built):
    clothes = {"hair", "jersey", "shoe", "shorts", "skin", "sock", "sole"}
    assert set(built.regions) == clothes | {"eye", "iris", "lip"}
    assert np.all(np.bincount(built.region) > 50)


@pytest.mark.parametrize(
    ("above", "below", "height"),
    [
        ("jersey", "shorts", 0.9619 + 0.125),
        ("shorts", "skin", 0.9619 - 0.398),
        ("skin", "sock", 0.5254 - 0.345),
        ("shoe", "sole", 0.0702 - 0.048),
    ],
)
def test_level_borders_are_level(built, above, below, height):
    found = border(built, above, below)
    assert len(found) > 50
    np.testing.assert_allclose(found[:, 2], height, atol=2e-4)


def test_borders_lie_on_the_curves_that_are_written(built, shipped_player):
    """Within a tenth of a millimetre, neckline, armholes, hair, eyes and mouth alike."""
    pairs = built.mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    owner = np.repeat(built.region, 3)
    lowest = np.full(len(built.mesh.points), 99)
    highest = np.full(len(built.mesh.points), -1)
    np.minimum.at(lowest, pairs.ravel(), np.repeat(owner, 2))
    np.maximum.at(highest, pairs.ravel(), np.repeat(owner, 2))
    points = built.mesh.points[lowest < highest]
    assert len(points) > 1000
    off = [
        np.abs(patch.field(points - built.bind_q[shipped_player.body(patch.body), :3]))
        for patch in clothes.of(shipped_player)
    ]
    assert np.min(off, axis=0).max() < 1e-4


def test_necklines_and_armholes_do_not_zigzag(built):
    """From one edge of a border to the next, its direction turns little."""
    inside = built.mesh.faces[built.region == built.regions.index("jersey")]
    pairs, counts = edges(inside)
    rim = pairs[counts == 1]
    follows = {int(p): rim[(rim == p).any(axis=1)] for p in np.unique(rim)}
    turns = []
    for point, both in follows.items():
        assert len(both) == 2
        a, b = (built.mesh.points[int(e.sum()) - point] - built.mesh.points[point] for e in both)
        turns.append(np.degrees(np.pi - np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))))
    assert len(turns) > 200 and np.percentile(turns, 98) < 25.0


def test_soles_are_flat_and_of_one_colour(built):
    body = solid(built.mesh.points, built.mesh.faces)
    under = (body.triangles_center[:, 2] < 0.03) & (body.face_normals[:, 2] < -0.7)
    assert body.area_faces[under].sum() > 0.03
    assert set(built.region[under]) == {built.regions.index("sole")}
    level = (body.triangles_center[:, 2] < 0.03) & (body.face_normals[:, 2] < -0.95)
    z = built.mesh.points[built.mesh.faces[level], 2]
    assert z.min() > 0.002 and np.percentile(z, 97) - z.min() < 0.004


def test_it_has_a_face(built):
    """Two eyes and a mouth between brow and chin, alike on both sides, and of their size."""
    body = solid(built.mesh.points, built.mesh.faces)
    for region, height, area in (("iris", 1.681, 1.1e-4), ("lip", 1.618, 2.0e-4)):
        mine = built.region == built.regions.index(region)
        centre = body.triangles_center[mine]
        assert centre[:, 0].min() > 0.05
        assert np.average(centre[:, 2], weights=body.area_faces[mine]) == pytest.approx(height, abs=0.005)
        sides = [body.area_faces[mine][side].sum() for side in (centre[:, 1] > 0.0, centre[:, 1] < 0.0)]
        assert sides[0] == pytest.approx(sides[1], rel=0.1)
        assert sum(sides) > area


def test_any_model_gets_a_skin(tmp_path):
    (tmp_path / "m.xml").write_text(
        """<mujoco><worldbody><body name="a" pos="0 0 1"><freejoint name="root"/>
        <geom type="capsule" size=".08 .2"/><body name="b" pos="0 0 .3"><joint name="j" type="ball"/>
        <geom type="box" size=".05 .1 .1" pos="0 0 .1"/></body></body></worldbody></mujoco>"""
    )
    built = skin.of(Model.load(tmp_path / "m.xml"))
    body = solid(built.mesh.points, built.mesh.faces)
    assert body.is_watertight and body.volume > 0.008
    assert set(np.unique(built.bodies[:, 0])) == {0, 1}


def test_a_model_without_a_body_to_cover_is_refused(tmp_path):
    (tmp_path / "m.xml").write_text(
        """<mujoco><worldbody><body name="ball"><freejoint name="ball"/><geom type="sphere" size=".1"/>
        </body></worldbody></mujoco>"""
    )
    with pytest.raises(ValueError, match="no shapes"):
        skin.of(Model.load(tmp_path / "m.xml"))


def test_the_net_of_a_ball_is_a_ball():
    lump = flesh.blob("a", (0.0, 0.0, 0.0), (0.1, 0.1, 0.1))
    union = Union([lump], {"a": 0}, np.array([[0.01, 0.02, 0.03, 0.0, 0.0, 0.0, 1.0]]))
    axes = [np.linspace(-0.2, 0.2, n) for n in (41, 51, 37)]
    points, faces = surface_net(union.on_grid(axes), axes)
    ball = solid(onto(union, None, points), faces)
    assert ball.is_watertight
    assert ball.volume == pytest.approx(4.0 / 3.0 * np.pi * 0.001, rel=0.02)
    assert np.allclose(np.linalg.norm(ball.vertices - [0.01, 0.02, 0.03], axis=1), 0.1, atol=1e-5)


def test_mirrored_primitives_mirror_the_surface():
    for lump in flesh.SIDE:
        if lump.body.startswith("l_"):
            twin = lump.mirrored()
            x = np.random.default_rng(0).uniform(-0.3, 0.3, (50, 3))
            from warpdribble.skin.implicit import distance

            assert np.allclose(distance(lump, x), distance(twin, x * [1.0, -1.0, 1.0]))
            assert twin.body == "r" + lump.body[1:]
