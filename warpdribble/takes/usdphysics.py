"""A take's UsdPhysics: enough for another engine to simulate the player and the ball again.

Every body has its full MassAPI (an engine that misses a part of it falls back to a default density), every
colliding shape a gprim of purpose "guide" with its material, every joint its frames, limits and drives, and
what does not meet in the model is a filtered pair. Angles are degrees and the gains of an
angular drive are per degree, as the schema has it: stiffness in mass x distance^2 / degree / second^2.
"""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade
from scipy.spatial.transform import Rotation

from ..sims.model import Model, Shape
from . import usdjoints
from .scene import home


def add(
    stage: Usd.Stage, base: str, model: Model, body_q: np.ndarray, paths: dict[str, str], joints: str
) -> None:
    """Bodies, colliders and joints of the model below `base`, as they stand in body_q (nbody, 7). paths: of
    the bodies, by name."""
    colliders = {}
    for body, name in enumerate(model.body_names):
        prim = stage.GetPrimAtPath(paths[name])
        if not usdjoints.is_static(model, body):
            _rigid(prim, model, body)
        colliders[paths[name]] = _colliders(stage, paths[name], [s for s in model.shapes if s.body == body])
    usdjoints.add(stage, base, model, body_q, paths, joints)
    apart = {
        frozenset(paths[model.body_names[body]] for body in pair) for pair in model.excluded if min(pair) >= 0
    }
    _filter(stage, colliders, apart)


def add_world(stage: Usd.Stage, model: Model, shapes: list[Shape]) -> None:
    """Gravity, and the colliders of the world's own shapes below `/World/Court`."""
    scene = UsdPhysics.Scene.Define(stage, "/World/PhysicsScene")
    gravity = np.asarray(model.gravity, float)
    size = float(np.linalg.norm(gravity))
    scene.CreateGravityDirectionAttr(Gf.Vec3f(*(gravity / size if size else [0.0, 0.0, -1.0])))
    scene.CreateGravityMagnitudeAttr(size)
    _colliders(stage, "/World/Court", shapes, "fixed")


def principal(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Moments (3,) [kg m^2] and the rotation xyzw (4,) from principal axes to the body's, of a tensor (3,
    3)."""
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] = -axes[:, 2]
    return moments, Rotation.from_matrix(axes).as_quat()


def _rigid(prim: Usd.Prim, model: Model, body: int) -> None:
    UsdPhysics.RigidBodyAPI.Apply(prim)
    mass = UsdPhysics.MassAPI.Apply(prim)
    moments, axes = principal(model.body_inertia[body])
    mass.CreateMassAttr(float(model.body_mass[body]))
    mass.CreateCenterOfMassAttr(Gf.Vec3f(*model.body_com[body].tolist()))
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*moments.tolist()))
    mass.CreatePrincipalAxesAttr(quatf(axes))


def quatf(xyzw: np.ndarray) -> Gf.Quatf:
    x, y, z, w = (float(v) for v in xyzw)
    return Gf.Quatf(w, x, y, z)


def _colliders(stage: Usd.Stage, parent: str, shapes: list[Shape], name: str = "") -> list[tuple[str, Shape]]:
    """A gprim per colliding shape, `<body>_collider`, `<body>_collider_2`, ..., not rendered; path and shape
    of each."""
    name = name or parent.rpartition("/")[2]
    made = []
    for number, shape in enumerate((s for s in shapes if s.contype or s.conaffinity), 1):
        path = f"{parent}/{name}_collider" + (f"_{number}" if number > 1 else "")
        gprim = _gprim(stage, path, shape)
        gprim.CreatePurposeAttr(UsdGeom.Tokens.guide)
        gprim.AddTranslateOp().Set(Gf.Vec3d(*map(float, shape.pos)))
        gprim.AddOrientOp().Set(quatf(shape.quat))
        if shape.kind == "box":
            gprim.AddScaleOp().Set(Gf.Vec3f(*map(float, shape.size)))
        UsdPhysics.CollisionAPI.Apply(gprim.GetPrim())
        material = _material(stage, home(path), shape)
        binding = UsdShade.MaterialBindingAPI.Apply(gprim.GetPrim())
        binding.Bind(material, UsdShade.Tokens.weakerThanDescendants, "physics")
        made.append((path, shape))
    return made


def _gprim(stage: Usd.Stage, path: str, shape: Shape) -> UsdGeom.Gprim:
    """A shape as gprim; a box is a cube of half size 1, to be scaled."""
    if shape.kind == "sphere":
        prim = UsdGeom.Sphere.Define(stage, path)
        half = np.full(3, float(shape.size[0]))
        prim.CreateRadiusAttr(half[0])
    elif shape.kind == "capsule":
        prim = UsdGeom.Capsule.Define(stage, path)
        radius, reach = float(shape.size[0]), float(shape.size[1])
        half = np.array([radius, radius, radius + reach])
        prim.CreateAxisAttr("Z")
        prim.CreateRadiusAttr(radius)
        prim.CreateHeightAttr(2.0 * reach)
    elif shape.kind == "box":
        prim = UsdGeom.Cube.Define(stage, path)
        half = np.ones(3)
        prim.CreateSizeAttr(2.0)
    else:
        prim = UsdGeom.Plane.Define(stage, path)
        half = np.array([14.0, 14.0, 0.0])
        prim.CreateAxisAttr("Z")
        prim.CreateWidthAttr(28.0)
        prim.CreateLengthAttr(28.0)
    prim.CreateExtentAttr([Gf.Vec3f(*(-half).tolist()), Gf.Vec3f(*half.tolist())])
    return prim


def _material(stage: Usd.Stage, where: str, shape: Shape) -> UsdShade.Material:
    """A shape's friction and restitution as a material, made once below `where`.

    The model multiplies the restitutions of two shapes; PhysX is told so, other engines have rules of their
    own.
    """
    friction, restitution = float(shape.friction), float(shape.restitution)
    name = f"contact_f{round(1000 * friction):04d}_r{round(1000 * restitution):04d}"
    path = f"{where}/Materials/{name}"
    if stage.GetPrimAtPath(path):
        return UsdShade.Material.Get(stage, path)
    UsdGeom.Scope.Define(stage, f"{where}/Materials")
    material = UsdShade.Material.Define(stage, path)
    contact = UsdPhysics.MaterialAPI.Apply(material.GetPrim())
    contact.CreateStaticFrictionAttr(friction)
    contact.CreateDynamicFrictionAttr(friction)
    contact.CreateRestitutionAttr(restitution)
    prim = material.GetPrim()
    rule = prim.CreateAttribute(
        "physxMaterial:restitutionCombineMode", Sdf.ValueTypeNames.Token, custom=False
    )
    prim.AddAppliedSchema("PhysxMaterialAPI")
    rule.Set("multiply")
    return material


def _filter(
    stage: Usd.Stage, colliders: dict[str, list[tuple[str, Shape]]], excluded: set[frozenset[str]]
) -> None:
    """Filtered pairs of what never meets in the model: of bodies where none of their shapes do, else of
    shapes.

    colliders: path and shape of each, by the path of their body. excluded: bodies that the file keeps apart,
    by their paths. (PhysX, Newton and MuJoCo read filtered
    pairs; MuJoCo reads no collision groups.)
    """
    apart: dict[str, list[str]] = {}
    bodies = [item for item in colliders.items() if item[1]]
    for i, (path_a, shapes_a) in enumerate(bodies):
        for path_b, shapes_b in bodies[i + 1 :]:
            never = [(a, b) for a, x in shapes_a for b, y in shapes_b if not _meet(x, y)]
            all_never = len(never) == len(shapes_a) * len(shapes_b)
            if all_never or frozenset((path_a, path_b)) in excluded:
                never = [(path_a, path_b)]
            for a, b in never:
                apart.setdefault(a, []).append(b)
    for path, others in apart.items():
        UsdPhysics.FilteredPairsAPI.Apply(stage.GetPrimAtPath(path)).CreateFilteredPairsRel().SetTargets(
            others
        )


def _meet(a: Shape, b: Shape) -> bool:
    return bool(a.contype & b.conaffinity or b.contype & a.conaffinity)
