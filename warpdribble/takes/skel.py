"""The skin of a take as UsdSkel: a skeleton with the player's bodies as joints, its animation, a skinned
mesh."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, Vt
from scipy.spatial.transform import Rotation

from ..sims.model import Model
from ..skin import flesh, skin
from . import figure
from .names import prim_name, prim_names
from .scene import add_mesh, home, material


def add(
    stage: Usd.Stage,
    player: str,
    model: Model,
    body_q: np.ndarray,
    animation: Usd.EditTarget | None = None,
) -> None:
    """The skin below `player`/Skin, in the stage's edit target; moving as body_q (frames, nbody, 7) where an
    edit target `animation` is given."""
    built = skin.of(model)
    root = UsdSkel.Root.Define(stage, f"{player}/Skin")
    Usd.ModelAPI(root.GetPrim()).SetKind(Kind.Tokens.subcomponent)
    skeleton = UsdSkel.Skeleton.Define(stage, f"{player}/Skin/Skeleton")
    bodies, joints = joint_paths(model)
    skeleton.CreateJointsAttr(Vt.TokenArray(joints))
    skeleton.CreateBindTransformsAttr(_matrices(built.bind_q[bodies]))
    skeleton.CreateRestTransformsAttr(_matrices(local_poses(model, built.bind_q[None], bodies)[0]))

    path = f"{player}/Skin/Body_visual"
    mesh = add_mesh(stage, path, built.mesh, None)
    _paint(stage, mesh, built)
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    place = np.full(model.nbody, 0)
    place[bodies] = np.arange(len(bodies))
    indices = np.ascontiguousarray(place[built.bodies].astype(np.int32).ravel())
    weights = np.ascontiguousarray(built.weights.astype(np.float32).ravel())
    binding.CreateJointIndicesPrimvar(False, skin.INFLUENCES).Set(Vt.IntArray.FromNumpy(indices))
    binding.CreateJointWeightsPrimvar(False, skin.INFLUENCES).Set(Vt.FloatArray.FromNumpy(weights))
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1.0))
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets(
        [f"{player}/Skin/Animation"]
    )
    UsdSkel.Animation.Define(stage, f"{player}/Skin/Animation")
    if animation is not None:
        animate(animation.GetLayer(), player, model, body_q)


def animate(layer: Sdf.Layer, player: str, model: Model, body_q: np.ndarray) -> None:
    """Local translations and rotations of all joints: default = frame 0, and a sample per frame of body_q
    (frames, nbody, 7)."""
    bodies, joints = joint_paths(model)
    local = local_poses(model, np.asarray(body_q, float), bodies)
    places = np.ascontiguousarray(local[..., :3], np.float32)
    turns = np.ascontiguousarray(figure.continuous_quaternions(local[..., 3:]), np.float32)
    with Sdf.ChangeBlock():
        prim = Sdf.CreatePrimInLayer(layer, f"{player}/Skin/Animation")
        names = Sdf.AttributeSpec(prim, "joints", Sdf.ValueTypeNames.TokenArray, Sdf.VariabilityUniform)
        names.default = Vt.TokenArray(joints)
        scales = Sdf.AttributeSpec(prim, "scales", Sdf.ValueTypeNames.Half3Array)
        scales.default = Vt.Vec3hArray.FromNumpy(np.ones((len(joints), 3), np.float16))
        for name, kind, values, pack in (
            ("translations", Sdf.ValueTypeNames.Float3Array, places, Vt.Vec3fArray),
            ("rotations", Sdf.ValueTypeNames.QuatfArray, turns, Vt.QuatfArray),
        ):
            attribute = Sdf.AttributeSpec(prim, name, kind)
            attribute.default = pack.FromNumpy(values[0])
            if len(values) > 1:
                for frame, value in enumerate(values):
                    layer.SetTimeSample(attribute.path, float(frame), pack.FromNumpy(value))


def joint_paths(model: Model) -> tuple[list[int], list[str]]:
    """Bodies that a skin may follow, all but the ball's, and their paths in the skeleton."""
    balls = flesh.ball_bodies(model)
    bodies = [b for b in range(model.nbody) if b not in balls]
    names = prim_names([model.body_names[b] for b in bodies])
    paths: dict[int, str] = {}
    for b in bodies:
        own = names[model.body_names[b]]
        parent = int(model.body_parent[b])
        paths[b] = f"{paths[parent]}/{own}" if parent >= 0 else own
    return bodies, [paths[b] for b in bodies]


def local_poses(model: Model, body_q: np.ndarray, bodies: list[int]) -> np.ndarray:
    """(frames, joints, 7) of each body in its parent's frame, from body_q (frames, nbody, 7) in the world."""
    local = np.array(body_q[:, bodies], float)
    for joint, b in enumerate(bodies):
        parent = int(model.body_parent[b])
        if parent >= 0:
            back = Rotation.from_quat(body_q[:, parent, 3:]).inv()
            local[:, joint, :3] = back.apply(body_q[:, b, :3] - body_q[:, parent, :3])
            local[:, joint, 3:] = (back * Rotation.from_quat(body_q[:, b, 3:])).as_quat()
    return local


def _matrices(poses: np.ndarray) -> Vt.Matrix4dArray:
    """Poses (n, 7) as matrices that act on rows."""
    matrices = np.tile(np.eye(4), (len(poses), 1, 1))
    matrices[:, :3, :3] = Rotation.from_quat(poses[:, 3:]).as_matrix().transpose(0, 2, 1)
    matrices[:, 3, :3] = poses[:, :3]
    return Vt.Matrix4dArray([Gf.Matrix4d(m.tolist()) for m in matrices])


def _paint(stage: Usd.Stage, mesh: UsdGeom.Mesh, built: skin.Skin) -> None:
    """A subset of faces and a material per region, that together cover the mesh, and a colour per face."""
    for number, region in enumerate(built.regions):
        faces = np.flatnonzero(built.region == number).astype(np.int32)
        name = prim_name(region)
        subset = UsdGeom.Subset.CreateGeomSubset(
            mesh, name, UsdGeom.Tokens.face, Vt.IntArray.FromNumpy(faces), UsdShade.Tokens.materialBind
        )
        surface = material(stage, built.colours[region], home(str(mesh.GetPath())))
        UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(surface)
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).SetMaterialBindSubsetsFamilyType(
        UsdGeom.Tokens.partition
    )
    primvar = mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.uniform)
    primvar.Set([Gf.Vec3f(*map(float, built.colours[r][:3])) for r in built.regions])
    primvar.SetIndices(Vt.IntArray.FromNumpy(np.ascontiguousarray(built.region, np.int32)))
