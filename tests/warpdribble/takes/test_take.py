from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from pxr import Gf, Usd, UsdGeom, UsdShade
from scipy.spatial.transform import Rotation

from warpdribble.sims import Model
from warpdribble.sims.model import pose
from warpdribble.skin.meshes import ball_parts, merge, seam_field, shape_mesh, weld
from warpdribble.skin.surface_net import open_points
from warpdribble.takes import take as take_module
from warpdribble.takes.figure import coloured
from warpdribble.takes.take import Take, TakeError, check_writable, validate, write_take

FPS = 50.0


@pytest.fixture(scope="module")
def player():
    return Model.load("player")


@pytest.fixture(scope="module")
def take(player):
    """Twelve frames of a player and a ball that turn and rise."""
    joint_q = np.tile(player.start_q, (12, 1))
    for name, speed in (("root", 0.3), ("ball", 0.9)):
        place = player.q_slice(name)
        angle = speed * np.arange(12)
        joint_q[:, place.start + 2] += 0.02 * np.arange(12)
        turns = Rotation.from_rotvec(angle[:, None] * [0.0, 0.6, 0.8])
        joint_q[:, place.start + 3 : place.stop] = turns.as_quat()
    body_q = pose.forward(player, joint_q)
    return Take(list(player.body_names), player.shapes, body_q, FPS, notes={"clip": "test"})


@pytest.fixture(params=[".usda", ".usdc", ".usdz"])
def written(request, take, tmp_path):
    return write_take(tmp_path / f"take{request.param}", take)


def test_a_take_is_valid_usd(written):
    assert validate(written) == []


def test_stage_says_units_axis_and_times(written, take):
    stage = Usd.Stage.Open(str(written))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert stage.GetMetadata("kilogramsPerUnit") == 1.0
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == FPS
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, len(take.body_q) - 1)
    assert stage.GetDefaultPrim().GetPath() == "/World"


def test_bodies_read_back_at_every_frame_and_by_default(written, take):
    stage = Usd.Stage.Open(str(written))
    for name in ("pelvis", "l_index_3", "r_foot", "ball"):
        path = "/World/Ball" if name == "ball" else f"/World/Player/{name}"
        prim = UsdGeom.Xformable(stage.GetPrimAtPath(path))
        body = take.body_names.index(name)
        for time in (*range(len(take.body_q)), Usd.TimeCode.Default()):
            frame = 0 if time == Usd.TimeCode.Default() else time
            matrix = np.array(prim.ComputeLocalToWorldTransform(time))
            turn = Rotation.from_quat(take.body_q[frame, body, 3:]).as_matrix()
            assert np.allclose(matrix[3, :3], take.body_q[frame, body, :3], atol=1e-9)
            assert np.allclose(matrix[:3, :3].T, turn, atol=1e-5)


def test_neighbouring_orientations_have_the_same_sign(written):
    stage = Usd.Stage.Open(str(written))
    orient = stage.GetAttributeAtPath("/World/Ball.xformOp:orient")
    values = [orient.Get(time) for time in range(12)]
    for a, b in pairwise(values):
        assert a.GetReal() * b.GetReal() + Gf.Dot(a.GetImaginary(), b.GetImaginary()) > 0.0


def test_every_mesh_can_be_seen(written):
    stage = Usd.Stage.Open(str(written))
    meshes = [UsdGeom.Mesh(p) for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)]
    assert len(meshes) > 50
    for mesh in meshes:
        points = np.array(mesh.GetPointsAttr().Get())
        normals = np.array(mesh.GetNormalsAttr().Get())
        assert mesh.GetPrim().GetName().rstrip("_0123456789").endswith("visual")
        corners = mesh.GetNormalsInterpolation() == "faceVarying"
        assert len(normals) == (len(mesh.GetFaceVertexIndicesAttr().Get()) if corners else len(points))
        assert np.allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-5)
        low, high = np.array(mesh.GetExtentAttr().Get())
        assert np.allclose(low, points.min(axis=0)) and np.allclose(high, points.max(axis=0))
        assert mesh.GetDisplayColorAttr().Get()
        material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
        shader = material.ComputeSurfaceSource()[0]
        assert shader.GetIdAttr().Get() == "UsdPreviewSurface"


def test_the_same_path_can_be_written_twice(take, tmp_path):
    path = tmp_path / "take.usdc"
    write_take(path, take)
    shorter = Take(take.body_names, take.shapes, take.body_q[:5], FPS)
    write_take(path, shorter)
    assert Usd.Stage.Open(str(path)).GetEndTimeCode() == 4


def test_a_failure_leaves_the_old_file_and_nothing_else(take, tmp_path, monkeypatch):
    path = write_take(tmp_path / "take.usdc", take)
    before = path.read_bytes()

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(take_module.scene, "add_surroundings", fail)
    with pytest.raises(TakeError, match="No space left"):
        write_take(path, take)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["take.usdc"]
    with pytest.raises(TakeError):
        write_take(tmp_path / "new.usda", take)
    assert [p.name for p in tmp_path.iterdir()] == ["take.usdc"]


def test_names_that_cannot_be_written_are_refused(tmp_path):
    (tmp_path / "file").write_text("x")
    (tmp_path / "folder.usda").mkdir()
    for name in ("take.fbx", "take", "file/take.usda", "folder.usda"):
        with pytest.raises(TakeError) as refused:
            check_writable(tmp_path / name)
        assert "\n" not in str(refused.value)


def test_arrays_that_do_not_fit_are_refused(take, player):
    flat = take.body_q.copy()
    flat[3, 5, 3:] = 0.0
    wrong = take.body_q.copy()
    wrong[7, 2, 1] = np.nan
    none = np.zeros((0, *take.body_q.shape))
    for body_q, said in (
        (take.body_q[:, :-1], "should be"),
        (take.body_q[0], "should be"),
        (take.body_q[:0], "at least one frame"),
        (none, "at least one frame"),
        (wrong, "not finite, first in frame 7"),
        (wrong[None] * np.ones((3, 1, 1, 1)), "not finite, first in frame 7"),
        (flat, "quaternions of length 0"),
    ):
        with pytest.raises(ValueError, match=said):
            Take(take.body_names, take.shapes, body_q, FPS)
    for fps in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="fps"):
            Take(take.body_names, take.shapes, take.body_q, fps)
    with pytest.raises(ValueError, match="those of the model"):
        Take(take.body_names[::-1], take.shapes, take.body_q, FPS, model=player)


def test_one_frame_is_enough(take, tmp_path):
    still = Take(take.body_names, take.shapes, take.body_q[:1], FPS)
    stage = Usd.Stage.Open(str(write_take(tmp_path / "still.usdc", still)))
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, 0)
    assert validate(tmp_path / "still.usdc") == []


def test_a_binary_take_is_one_file_and_a_text_take_lies_over_layers(take, tmp_path):
    write_take(tmp_path / "one.usdc", take)
    write_take(tmp_path / "pack.usdz", take)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["one.usdc", "pack.usdz"]
    write_take(tmp_path / "text.usda", take)
    write_take(tmp_path / "whole.usda", take, layered=False)
    beside = [f"text.{name}" for name in ("animation.usdc", "physics.usda", "scene.usdc", "usda")]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["one.usdc", "pack.usdz", *beside, "whole.usda"]
    text = (tmp_path / "text.usda").read_text()
    assert "./text.animation.usdc" in text and "timeSamples" not in text
    for layer in ("animation.usdc", "physics.usda", "scene.usdc"):
        stage = Usd.Stage.Open(str(tmp_path / f"text.{layer}"))
        assert (stage.GetTimeCodesPerSecond(), stage.GetFramesPerSecond()) == (FPS, FPS)
    with pytest.raises(TakeError, match="one file"):
        write_take(tmp_path / "pack.usdz", take, layered=True)


@pytest.mark.parametrize("name", ["a b", "ünïcode-ö", "x" * 200, "100%", "a.b.c", "-x", "@#&", "q'uote"])
@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usdz"])
def test_odd_names_are_written(take, tmp_path, name, suffix):
    path = write_take(tmp_path / f"{name}{suffix}", take)
    assert validate(path) == []


@pytest.mark.parametrize("name", ["x" * 300 + ".usdc", "nul\0byte.usda", ".usdc"])
def test_impossible_names_are_refused(take, tmp_path, name):
    with pytest.raises(TakeError):
        write_take(tmp_path / name, take)
    assert list(tmp_path.iterdir()) == []


def test_bodies_whose_names_are_alike_stay_apart(tmp_path):
    names = ["a-b", "a_b", "a.b", "Joints", "1st"]
    shape = {"kind": "sphere", "size": [0.1], "pos": np.zeros(3), "quat": [0.0, 0.0, 0.0, 1.0]}
    shapes = [SimpleNamespace(name=n, body=i, rgba=[1, 0, 0, 1], **shape) for i, n in enumerate(names)]
    body_q = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (2, len(names), 1))
    body_q[:, :, 0] = np.arange(len(names))
    path = write_take(tmp_path / "take.usdc", Take(names, shapes, body_q, FPS))
    stage = Usd.Stage.Open(str(path))
    children = stage.GetPrimAtPath("/World/Player").GetChildren()
    found = [UsdGeom.Xformable(p).ComputeLocalToWorldTransform(0)[3][0] for p in children]
    assert sorted(found) == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert validate(path) == []


def test_another_judge_finds_nothing_either(take, player, tmp_path):
    pytest.importorskip("omni.asset_validator", reason="pip install omniverse-asset-validator")
    from omni.asset_validator import ValidationEngine

    full = Take.of(player, take.body_q, FPS)
    many = Take.of(player, np.stack([take.body_q] * 3), FPS)
    crowd = Take.of(player, np.stack([take.body_q] * 5), FPS)
    for name, shown, more in (
        ("a.usda", full, {"joints": "d6"}), ("b.usdc", full, {"skin": True}), ("c.usdz", full, {}),
        ("d.usdc", many, {"skin": True, "joints": "spherical"}), ("e.usdc", crowd, {}),
    ):  # fmt: skip
        path = write_take(tmp_path / name, shown, **more)
        assert [str(issue) for issue in ValidationEngine().validate(str(path)).issues()] == []


SHAPES = {
    "sphere": ([0.12], 4 / 3 * np.pi * 0.12**3),
    "capsule": ([0.05, 0.2], np.pi * 0.05**2 * 0.4 + 4 / 3 * np.pi * 0.05**3),
    "box": ([0.1, 0.05, 0.03], 8 * 0.1 * 0.05 * 0.03),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_meshes_enclose_their_shape_and_face_outward(kind):
    size, volume = SHAPES[kind]
    turn = Rotation.from_rotvec([0.3, -0.2, 0.5])
    shape = SimpleNamespace(
        name="s", kind=kind, size=np.array(size), pos=np.array([1.0, 2.0, 3.0]), quat=turn.as_quat()
    )
    mesh = shape_mesh(shape)
    a, b, c = (mesh.points[mesh.faces[:, k]] - shape.pos for k in range(3))
    enclosed = np.sum(a * np.cross(b, c)) / 6.0
    assert enclosed == pytest.approx(volume, rel=0.06)
    faces = np.cross(b - a, c - a)
    faces /= np.maximum(np.linalg.norm(faces, axis=1, keepdims=True), 1e-15)
    shown = mesh.normals[mesh.faces].mean(axis=1)
    assert np.sum(faces * shown, axis=1).min() > 0.5


def test_the_ball_is_cut_along_its_seams():
    """Panels and seams close to one sphere, the edges between them lie on the seams' own, and the seams' area
    is that of points strewn evenly over a sphere."""
    ball = SimpleNamespace(
        name="ball", kind="sphere", size=[0.1193], pos=np.zeros(3), quat=[0.0, 0.0, 0.0, 1.0]
    )
    panels, seams = ball_parts(shape_mesh(ball))
    points, faces = weld(merge([panels, seams]))
    whole = trimesh.Trimesh(points, faces, process=False)
    assert whole.is_watertight and whole.is_winding_consistent
    assert np.allclose(np.linalg.norm(points, axis=1), 0.1193, atol=1e-6)
    rim = open_points(seams.faces)
    assert len(rim) > 500 and np.abs(seam_field(seams.points[rim])).max() * 0.1193 < 1e-6
    strewn = np.random.default_rng(0).normal(size=(200_000, 3))
    area = trimesh.Trimesh(seams.points, seams.faces, process=False).area
    assert area / whole.area == pytest.approx(np.mean(seam_field(strewn) < 0.0), rel=0.02)


def test_what_is_no_sphere_has_no_seams(tmp_path):
    text = """<mujoco><worldbody><body name="ball"><freejoint/><geom type="box" size=".1 .1 .2"/></body>
    </worldbody></mujoco>"""
    (tmp_path / "m.xml").write_text(text)
    shapes = Model.load(tmp_path / "m.xml").shapes
    assert len(coloured(shapes, seams=True)) == 1
