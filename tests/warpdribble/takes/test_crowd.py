import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdPhysics

from warpdribble.takes import crowd
from warpdribble.takes.take import Take, validate, write_take


def worlds_of(take, count):
    """Worlds that differ: each begins two frames later."""
    return Take.of(take.model, np.stack([np.roll(take.body_q, -2 * w, 0) for w in range(count)]), take.fps)


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usdz"])
@pytest.mark.parametrize("count", [2, 9])
def test_many_worlds_are_valid(dribble_take, tmp_path, count, suffix):
    assert validate(write_take(tmp_path / f"take{suffix}", worlds_of(dribble_take, count))) == []


def test_a_few_worlds_are_references_of_one_prototype(dribble_take, tmp_path):
    take = worlds_of(dribble_take, 3)
    stage = Usd.Stage.Open(str(write_take(tmp_path / "take.usdc", take, spacing=2.0)))
    offsets = crowd.layout(3, 2.0)
    for world, frame in ((0, 0), (1, 5), (2, 35)):
        for name, path in (("r_hand", "Player/r_hand"), ("ball", "Ball")):
            prim = stage.GetPrimAtPath(f"/World/World_{world}/{path}")
            assert prim.HasAPI(UsdPhysics.RigidBodyAPI)
            assert any(child.IsA(UsdGeom.Mesh) for child in prim.GetChildren())
            place = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(frame))[3, :3]
            wanted = take.body_q[world, frame, take.body_names.index(name), :3] + offsets[world]
            assert np.allclose(place, wanted, atol=1e-6)
    roots = [p for p in stage.Traverse() if p.HasAPI(UsdPhysics.ArticulationRootAPI)]
    assert len(roots) == 3
    knee = UsdPhysics.Joint(stage.GetPrimAtPath("/World/World_2/Player/Joints/l_knee"))
    assert knee.GetBody1Rel().GetTargets() == ["/World/World_2/Player/l_lower_leg"]
    layer = stage.GetRootLayer()
    assert layer.GetPrimAtPath("/World/World_1/Player/r_hand/r_hand_visual") is None


def test_many_worlds_are_point_instances(dribble_take, tmp_path):
    take = worlds_of(dribble_take, 6)
    stage = Usd.Stage.Open(str(write_take(tmp_path / "take.usdc", take)))
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath(crowd.INSTANCER))
    assert len(instancer.GetPrototypesRel().GetTargets()) == 51
    offsets = crowd.layout(6, 3.0)
    ball = take.body_names.index("ball")
    for frame in (0, 7, 35):
        matrices = np.array(instancer.ComputeInstanceTransformsAtTime(frame, frame)).reshape(6, 51, 4, 4)
        wanted = take.body_q[:, frame, :, :3] + offsets[:, None]
        assert np.allclose(matrices[:, :, 3, :3], wanted, atol=1e-5)
        assert np.allclose(
            matrices[:, ball, :3, :3] @ matrices[:, ball, :3, :3].transpose(0, 2, 1), np.eye(3), atol=1e-3
        )
    default = np.array(instancer.GetPositionsAttr().Get()).reshape(6, 51, 3)
    assert np.allclose(default, take.body_q[:, 0, :, :3] + offsets[:, None], atol=1e-5)


@pytest.mark.parametrize("count", [1, 2, 5, 16, 17])
def test_worlds_stand_apart_about_the_origin(count):
    places = crowd.layout(count, 3.0)
    assert places.shape == (count, 3)
    apart = np.linalg.norm(places[:, None] - places, axis=-1) + 9.0 * np.eye(count)
    assert apart.min() >= 3.0
    assert np.allclose(places.min(axis=0) + places.max(axis=0), 0.0)
