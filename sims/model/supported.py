"""What a compiled model holds and this package does not simulate is refused by name; `fields` has the
tables."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .fields import MUST_BE_DEFAULT, UNDERSTOOD, WITHOUT_EFFECT, Default
from .mjcf import GEOMS, ModelError

if TYPE_CHECKING:
    import mujoco

Refusal = tuple[str, str]
"""What is not simulated, and what to do about it."""
ROWS = {
    "body": "body",
    "jnt": "joint",
    "dof": "joint",
    "geom": "geom",
    "actuator": "actuator",
    "tendon": "tendon",
    "eq": "equality constraint",
}
"""What the rows of a field are, by the field's first word."""
SAID_BY = {
    "body": "MjsBody",
    "jnt": "MjsJoint",
    "dof": "MjsJoint",
    "geom": "MjsGeom",
    "actuator": "MjsActuator",
}
"""The class of an element that a file can say, by the first word of its fields."""
PLAIN = """
<mujoco><worldbody><body><joint name="j"/><geom size="1"/></body></worldbody>
<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>
<actuator><position joint="j"/></actuator></mujoco>
"""


def check_supported(m: mujoco.MjModel, path: str | Path) -> list[str]:
    """Notes on a compiled model. Raises ModelError where it holds something that is not simulated: the
    message explains the first such thing and names the others."""
    found = [*_kinds(m), *_negative(m), *_changed(m), *_newer(m)]
    if found:
        (what, advice), *others = found
        also = f"; nor are: {', '.join(other for other, _ in others[:5])}" if others else ""
        also += ", ..." if len(others) > 5 else ""
        raise ModelError(f"{path}: {what} is not supported; {advice}{also}")
    return _notes(m)


def fields(m: mujoco.MjModel) -> set[str]:
    """Names of all fields of a compiled model, those of its options with "opt." before them."""

    def of(thing: Any) -> Iterator[str]:
        return (k for k in dir(thing) if not k.startswith("_") and not callable(getattr(thing, k)))

    return {*of(m), *(f"opt.{name}" for name in of(m.opt))}


def value(m: mujoco.MjModel, field: str) -> Any:
    return getattr(m.opt, field[4:]) if field.startswith("opt.") else getattr(m, field)


@cache
def plain() -> mujoco.MjModel:
    """A model that says no more than it must: what the installed MuJoCo takes for what a file leaves out."""
    import mujoco

    return mujoco.MjModel.from_xml_string(PLAIN)


def unknown(m: mujoco.MjModel) -> set[str]:
    """Fields in none of our tables: of a newer MuJoCo than the one that they were made for."""
    return fields(m).difference(UNDERSTOOD, MUST_BE_DEFAULT, *WITHOUT_EFFECT.values())


def _kinds(m: mujoco.MjModel) -> Iterator[Refusal]:
    """Joints and geoms of kinds that are not simulated."""
    for j in range(m.njnt):
        if m.jnt_type[j] == 2:
            yield f"slide joint '{m.joint(j).name}'", "use free, ball and hinge joints"
        if m.jnt_type[j] == 0 and m.body_parentid[m.jnt_bodyid[j]] != 0:
            yield f"free joint '{m.joint(j).name}' inside a tree", "put it on a top-level body"
        if m.jnt_type[j] == 0 and m.jnt_stiffness[j]:
            yield f"stiffness of free joint '{m.joint(j).name}'", "remove it"
    for g in range(m.ngeom):
        collides = m.geom_contype[g] or m.geom_conaffinity[g]
        kind = int(m.geom_type[g])
        if kind not in GEOMS and collides:
            yield (
                f"{_geom_type(kind)} geom '{m.geom(g).name or g}' that collides",
                "use capsules, boxes, spheres and planes, or set contype and conaffinity to 0",
            )
        if collides and m.geom_condim[g] > 3:
            yield f"condim {m.geom_condim[g]} of geom '{m.geom(g).name or g}'", "use condim 1 or 3"
        if kind == 0 and m.body_weldid[m.geom_bodyid[g]] != 0:
            yield f"plane '{m.geom(g).name or g}' on a moving body", "planes belong to the world"


def _negative(m: mujoco.MjModel) -> Iterator[Refusal]:
    """Springs, dampers and inertias that would feed a motion, which MuJoCo lets pass."""
    for field in ("jnt_stiffness", "dof_damping", "dof_armature", "actuator_damping", "actuator_armature"):
        for row in np.flatnonzero(value(m, field) < 0).tolist():
            word = field.partition("_")[2]
            yield f"negative {word} {value(m, field)[row]:g} of {_named(m, field, row)}", "make it positive"


def _geom_type(kind: int) -> str:
    import mujoco

    return mujoco.mjtGeom(kind).name.removeprefix("mjGEOM_").lower()


def _changed(m: mujoco.MjModel) -> Iterator[Refusal]:
    """What must be at its default and is not; one row of each field."""
    for field, rule in MUST_BE_DEFAULT.items():
        if field.endswith("flags"):
            yield from ((what, rule.advice) for what in _flags(m, field, rule))
            continue
        now, usual = value(m, field), value(plain(), field)
        if np.ndim(now) == 0:
            if now != usual:
                said = f"option {rule.word}" if field.startswith("opt.") else f"a {rule.word}"
                yield said, rule.advice
            continue
        differs = _differs(now, usual)
        if rule.where:
            differs &= rule.where(m)
        for row in np.flatnonzero(differs)[:1].tolist():
            said = f"{rule.word} {_numbers(now[row])} of " if rule.word else ""
            yield said + _named(m, field, row), rule.advice


def _flags(m: mujoco.MjModel, field: str, rule: Default) -> Iterator[str]:
    """Option flags that a file changes and may not."""
    import mujoco

    kind, word = ("DSBL", "disable") if field == "opt.disableflags" else ("ENBL", "enable")
    known = {**mujoco.mjtDisableBit.__members__, **mujoco.mjtEnableBit.__members__}
    names = {int(bit): name for name, bit in known.items() if name.startswith(f"mj{kind}_")}
    left = int(value(m, field))
    for bit in (1 << k for k in range(left.bit_length())):
        name = names.get(bit, str(bit)).removeprefix(f"mj{kind}_").lower()
        if left & bit and name not in rule.may.split():
            yield f"option flag {name}='{word}'"


def _differs(now: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """Mask of the rows of a field that are not as usual; all zero is, where the plain model has none."""
    return np.any(now != (usual[0] if len(usual) else 0), axis=tuple(range(1, now.ndim)))


def _newer(m: mujoco.MjModel) -> list[Refusal]:
    """Fields of a newer MuJoCo that a file can say, and that this one changes."""
    import mujoco

    found = []
    for field in sorted(unknown(m)):
        first, _, word = field.replace(".", "_").partition("_")
        now, usual = np.asarray(value(m, field)), np.asarray(value(plain(), field))
        if field.startswith("opt."):
            same, whose = np.array_equal(now, usual), f"option {word}"
        elif hasattr(getattr(mujoco, SAID_BY.get(first, ""), None), word) and now.ndim and len(usual):
            rows = np.flatnonzero(_differs(now, usual)).tolist()
            same = not rows
            whose = "" if same else f"{word} of {_named(m, field, rows[0])}"
        else:
            continue
        if not same:
            found.append((f"{whose} (new in MuJoCo {mujoco.__version__})", "remove it from the file"))
    return found


def _notes(m: mujoco.MjModel) -> list[str]:
    """What is left out because it does nothing as the file stands, or cannot be judged."""
    import mujoco

    notes = []
    if m.neq:
        notes.append(f"{m.neq} equality constraint(s) that are not active are left out")
    moving = [m.key(k).name or str(k) for k in range(m.nkey) if m.key_qvel[k].any()]
    if moving:
        notes.append(f"velocities of keyframes are left out: {', '.join(moving)}")
    new = sorted(unknown(m))
    if new:
        notes.append(
            f"MuJoCo {mujoco.__version__} is newer than what its models were read for: "
            f"{', '.join(new)} not looked at"
        )
    return notes


def _named(m: mujoco.MjModel, field: str, row: int) -> str:
    """ "geom 'floor'": what a row of a field is, by its name, else its number."""
    first = field.partition("_")[0]
    row = int(m.dof_jntid[row]) if first == "dof" else row
    names = {"jnt": "joint", "dof": "joint", "eq": "equality"}
    name = getattr(m, names.get(first, first))(row).name
    return f"{ROWS[first]} '{name or row}'"


def _numbers(row: Any) -> str:
    return " ".join(f"{number:g}" for number in np.atleast_1d(row))
