"""Takes read by other engines, from the USD file alone. Each is optional: `pip install newton
newton-usd-schemas`, and `mujoco[usd]`, which wants a usd-core of its own."""

import numpy as np
import pytest
from pxr import Usd, UsdPhysics

from warpdribble.takes.take import Take, write_take


def names_of(labels):
    return [str(label).rpartition("/")[2] for label in labels]


@pytest.mark.parametrize("joints", ["revolute", "d6", "spherical"])
def test_newton_has_the_same_player(dribble_take, shipped_player, tmp_path, joints):
    newton = pytest.importorskip("newton", reason="pip install newton")
    pytest.importorskip("newton_usd_schemas", reason="pip install newton-usd-schemas")
    path = write_take(tmp_path / "take.usdc", dribble_take, joints=joints)
    builder = newton.ModelBuilder()
    builder.add_usd(str(path))
    assert (builder.body_count, builder.joint_dof_count) == (shipped_player.nbody, shipped_player.nv)
    names = names_of(builder.body_label)
    drives = []
    for body, name in enumerate(shipped_player.body_names):
        there = names.index("Ball" if name == "ball" else name)
        assert builder.body_mass[there] == pytest.approx(shipped_player.body_mass[body], rel=1e-6)
        assert np.allclose(builder.body_com[there], shipped_player.body_com[body], atol=1e-6)
        inertia = np.array(builder.body_inertia[there]).reshape(3, 3)
        size = np.abs(inertia).max()
        assert np.allclose(inertia, shipped_player.body_inertia[body], rtol=1e-4, atol=1e-5 * size)
        assert np.allclose(np.array(builder.body_q[there])[:3], dribble_take.body_q[0, body, :3], atol=1e-5)
        drives.append(there)
    assert np.allclose(builder.gravity, [0.0, 0.0, -9.81], atol=1e-5)
    wanted = shipped_player.tables["dof_kp"]
    if joints != "spherical":
        found = np.sort(np.round(np.array(builder.joint_target_ke), 3))
        assert np.allclose(found, np.sort(wanted), rtol=1e-5)
        armature = np.sort(np.array(builder.joint_armature))
        assert np.allclose(armature, np.sort(shipped_player.tables["dof_armature"]), rtol=1e-5, atol=1e-9)
    restitution = set(np.round(builder.shape_material_restitution, 4))
    assert {0.0, 0.8, 1.0} <= restitution


def mujoco_with_usd(path):
    mujoco = pytest.importorskip("mujoco")
    try:
        return mujoco, mujoco.MjSpec.from_file(str(path)).compile()
    except ValueError as error:
        if "usd" in str(error).lower() or "decoder" in str(error).lower() or "XML" in str(error):
            pytest.skip(f"this MuJoCo reads no USD: {str(error).splitlines()[0]}")
        raise


@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_mujoco_has_the_same_player(dribble_take, shipped_player, tmp_path, suffix):
    path = write_take(tmp_path / f"take{suffix}", dribble_take)
    mujoco, m = mujoco_with_usd(path)
    assert (m.nbody - 1, m.nv) == (shipped_player.nbody, shipped_player.nv)
    data = mujoco.MjData(m)
    mujoco.mj_forward(m, data)
    names = names_of(m.body(b).name for b in range(m.nbody))
    for body, name in enumerate(shipped_player.body_names):
        there = names.index("Ball" if name == "ball" else name)
        assert m.body_mass[there] == pytest.approx(shipped_player.body_mass[body], rel=1e-6)
        assert np.allclose(data.xpos[there], dribble_take.body_q[0, body, :3], atol=1e-5)
        moments = np.linalg.eigvalsh(shipped_player.body_inertia[body])
        assert np.allclose(np.sort(m.body_inertia[there]), moments, rtol=1e-4, atol=1e-9)
    assert np.allclose(m.opt.gravity, [0.0, 0.0, -9.81], atol=1e-5)
    armature = np.sort(shipped_player.tables["dof_armature"])
    assert np.allclose(np.sort(m.dof_armature), armature, rtol=1e-5, atol=1e-9)
    elbow = names_of(m.joint(j).name for j in range(m.njnt)).index("r_elbow")
    stage = Usd.Stage.Open(str(path))
    drive = UsdPhysics.DriveAPI(stage.GetPrimAtPath("/World/Player/Joints/r_elbow"), "angular")
    start = np.radians(drive.GetTargetPositionAttr().Get())
    assert m.qpos0[m.jnt_qposadr[elbow]] == pytest.approx(start, abs=1e-5)
    assert np.allclose(m.jnt_range[elbow], [-0.09, 2.62], atol=1e-5)


def test_mujoco_falls_and_comes_to_rest(dribble_take, tmp_path):
    """Nothing blows up: shapes of the player pass through each other, as they do here, and the ball lies
    down."""
    mujoco, m = mujoco_with_usd(write_take(tmp_path / "take.usdc", dribble_take))
    m.opt.timestep = 0.001
    data = mujoco.MjData(m)
    mujoco.mj_step(m, data, nstep=1500)
    assert np.isfinite(data.qpos).all() and sum(w.number for w in data.warning) == 0
    assert data.body("/World/Ball").xpos[2] == pytest.approx(0.119, abs=0.01)


def test_mujoco_reads_three_worlds(dribble_take, shipped_player, tmp_path):
    take = Take.of(shipped_player, np.stack([dribble_take.body_q[:2]] * 3), 50.0)
    _, m = mujoco_with_usd(write_take(tmp_path / "take.usdc", take))
    assert m.nv == 3 * shipped_player.nv
    assert m.body_mass.sum() == pytest.approx(3 * shipped_player.body_mass.sum(), rel=1e-6)
