import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade, UsdSkel

from warpdribble.skin import skin
from warpdribble.takes.take import Take, TakeError, validate, write_take


@pytest.fixture(scope="module", params=[".usda", ".usdc", ".usdz"])
def stage(request, dribble_take, tmp_path_factory):
    path = tmp_path_factory.mktemp("skin") / f"take{request.param}"
    assert validate(write_take(path, dribble_take, skin=True)) == []
    return Usd.Stage.Open(str(path))


def skinned(stage, path, frame):
    """Points in the world as OpenUSD itself skins them."""
    root = UsdSkel.Root(stage.GetPrimAtPath(path))
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    (binding,) = cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(binding.GetSkeleton())
    (target,) = binding.GetSkinningTargets()
    points = UsdGeom.Mesh(target.GetPrim()).GetPointsAttr().Get()
    assert target.ComputeSkinnedPoints(query.ComputeSkinningTransforms(frame), points, frame)
    place = UsdGeom.Xformable(root).ComputeLocalToWorldTransform(frame)
    return np.array([place.Transform(p) for p in points])


@pytest.mark.parametrize("frame", [0, 17, 35])
def test_openusd_skins_it_as_we_do(stage, dribble_take, shipped_player, frame):
    wanted = skin.of(shipped_player).posed(dribble_take.body_q[frame].astype(float))
    found = skinned(stage, "/World/Player/Skin", frame)
    assert np.abs(found - wanted).max() < 1e-4


def test_the_player_is_seen_once(stage):
    meshes = [p.GetPath() for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)]
    under = [p for p in meshes if str(p).startswith("/World/Player")]
    assert under == ["/World/Player/Skin/Body_visual"]
    assert any(str(p).startswith("/World/Ball/") for p in meshes)


def test_every_face_has_one_material(stage):
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Player/Skin/Body_visual"))
    subsets = UsdShade.MaterialBindingAPI(mesh).GetMaterialBindSubsets()
    faces = np.concatenate([s.GetIndicesAttr().Get() for s in subsets])
    assert len(faces) == len(np.unique(faces)) == len(mesh.GetFaceVertexCountsAttr().Get())
    for subset in subsets:
        material, _ = UsdShade.MaterialBindingAPI(subset).ComputeBoundMaterial()
        assert material.ComputeSurfaceSource()[0].GetIdAttr().Get() == "UsdPreviewSurface"
    colours = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("displayColor")
    assert len(colours.ComputeFlattened()) == len(faces)


def test_worlds_wear_the_same_skin(dribble_take, tmp_path):
    worlds = np.stack([dribble_take.body_q, np.roll(dribble_take.body_q, 9, 0)])
    take = Take.of(dribble_take.model, worlds, 50.0)
    path = write_take(tmp_path / "two.usdc", take, skin=True, spacing=2.0)
    assert validate(path) == []
    stage = Usd.Stage.Open(str(path))
    built = skin.of(dribble_take.model)
    for world, offset in enumerate(([-0.0, -1.0, 0.0], [0.0, 1.0, 0.0])):
        found = skinned(stage, f"/World/World_{world}/Player/Skin", 12)
        assert np.abs(found - offset - built.posed(worlds[world, 12])).max() < 1e-4


def test_a_skin_needs_a_model(dribble_take, tmp_path):
    take = Take(dribble_take.body_names, dribble_take.shapes, dribble_take.body_q, 50.0)
    with pytest.raises(TakeError, match="model"):
        write_take(tmp_path / "take.usdc", take, skin=True)
