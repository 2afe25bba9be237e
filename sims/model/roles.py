"""Which of a model's bodies and joints play which part, as its file says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from .joints import Joint
from .mjcf import ModelError

if TYPE_CHECKING:
    from .model import Model

ASKED = {
    "root": "its first joint must be a free one",
    "root_body": "its first joint must be a free one",
    "ball": '<text name="ball"> in <custom> must name a body',
    "ball_joint": 'the body under <text name="ball"> in <custom> must have a free joint',
    "trunk": '<text name="trunk"> in <custom> must name a body',
    "head": '<text name="head"> in <custom> must name a body',
    "hands": '<text name="hands"> in <custom> must list the bodies of two hands, the left one first',
    "palms": '<text name="palms"> in <custom> must list two sites, the left one first',
    "knuckles": '<text name="knuckles"> in <custom> must list three fingers\' first bodies for each hand',
    "feet": '<text name="feet"> in <custom> must list the bodies of two feet, the left one first',
    "spine": 'the body under <text name="head"> in <custom> must hang on the root by joints',
    **dict.fromkeys(
        ("shoulders", "elbows", "wrists"),
        'each hand under <text name="hands"> in <custom> must end a limb of a shoulder, a hinge and a wrist',
    ),
    **dict.fromkeys(
        ("hips", "knees", "ankles"),
        'each foot under <text name="feet"> in <custom> must end a limb of a hip, a hinge and an ankle',
    ),
    "toes": '<text name="feet"> in <custom> must list a body with a hinge behind each foot',
}
"""What a file must have for a part to be played."""


@dataclass(frozen=True)
class Roles:
    """The parts of a model by name: bodies, joints and sites. Pairs are left before right, as the file lists
    them; what the file does not say is None or empty.

    The file says it in texts of its <custom> element. `feet` and `hands` list all bodies of both, and the one
    that carries the others is the foot, the hand. Limbs are found from there through the tree: the joint of
    the hand is its wrist, the hinge before it the elbow, the joint before that the shoulder.
    """

    file: str
    """The model's file, for messages."""
    root: str | None = None
    """Joint: the free one of the first tree."""
    root_body: str | None = None
    ball: str | None = None
    """Body."""
    ball_joint: str | None = None
    trunk: str | None = None
    """Body that pushes act on."""
    head: str | None = None
    """Body."""
    hands: tuple[str, ...] = ()
    """Bodies."""
    palms: tuple[str, ...] = ()
    """Sites in the palms; local z points out of them."""
    knuckles: tuple[tuple[str, ...], ...] = ()
    """For each hand the first bodies of the index, the middle and the little finger."""
    feet: tuple[str, ...] = ()
    """Bodies."""
    spine: tuple[str, ...] = ()
    """Joints from the root, which is not among them, up to the head."""
    shoulders: tuple[str, ...] = ()
    """Joints, as all below."""
    elbows: tuple[str, ...] = ()
    wrists: tuple[str, ...] = ()
    hips: tuple[str, ...] = ()
    knees: tuple[str, ...] = ()
    ankles: tuple[str, ...] = ()
    toes: tuple[str, ...] = ()

    def one(self, role: str) -> str:
        """The name behind "root", "root_body", "ball", "ball_joint", "trunk" or "head". Raises ModelError
        when the model has none."""
        name = getattr(self, role)
        if name is None:
            raise self._missing(role)
        return name

    def both(self, role: str) -> tuple[str, str]:
        """The left and the right name behind one of the other roles. Raises ModelError unless there are
        two."""
        names = getattr(self, role)
        if len(names) != 2:
            raise self._missing(role)
        return names

    def _missing(self, role: str) -> ModelError:
        return ModelError(f"{self.file}: the model has no {role.replace('_', ' ')}: {ASKED[role]}")


def find_roles(model: Model) -> Roles:
    """The roles of a model, from its texts and its tree. Raises ModelError for a text that names no body."""
    root = _first([joint.name for joint in model.joints[:1] if joint.kind == "free"])
    ball = _first(model.listed("ball"))
    head = _first(model.listed("head"))
    hands, feet = (_carrying(model, model.listed(text)) for text in ("hands", "feet"))
    free = [joint.name for joint in _joints(model, ball) if joint.kind == "free"]
    return Roles(
        file=str(model.path),
        root=root,
        root_body=None if root is None else model.body_names[model.joint_body(root)],
        ball=ball,
        ball_joint=_first(free),
        trunk=_first(model.listed("trunk")),
        head=head,
        hands=hands,
        palms=tuple(name for name in model.texts.get("palms", "").split() if name in model.sites),
        knuckles=_knuckles(model, hands, model.listed("knuckles")),
        feet=feet,
        spine=_spine(model, head),
        toes=_toes(model, feet, model.listed("feet")),
        **_limbs(model, hands, ("shoulders", "elbows", "wrists")),
        **_limbs(model, feet, ("hips", "knees", "ankles")),
    )


def _first(names: list[str]) -> str | None:
    return names[0] if names else None


def _parent(model: Model, body: str) -> str | None:
    parent = int(model.body_parent[model.body(body)])
    return None if parent < 0 else model.body_names[parent]


def _joints(model: Model, body: str | None) -> list[Joint]:
    """The joints that move a body against its parent."""
    return [] if body is None else model.body_joints(model.body(body))


def _carrying(model: Model, names: list[str]) -> tuple[str, ...]:
    """Those of the bodies that hang on none of them."""
    return tuple(name for name in names if _parent(model, name) not in names)


def _spine(model: Model, body: str | None) -> tuple[str, ...]:
    """Joints from a body down to its root, in the order from there up."""
    found: list[str] = []
    while body is not None:
        found = [joint.name for joint in _joints(model, body) if joint.kind != "free"] + found
        body = _parent(model, body)
    return tuple(found)


def _limbs(model: Model, ends: tuple[str, ...], roles: tuple[str, str, str]) -> dict[str, tuple[str, ...]]:
    """The three joints above each end of a limb, by role; empty unless each limb has them, the middle one a
    hinge: half a pair would pass for the other half."""
    found = []
    for end in ends:
        chain: list[Joint] = []
        body: str | None = end
        for _ in roles:
            joints = _joints(model, body)
            if body is None or len(joints) != 1:
                return {}
            chain.insert(0, joints[0])
            body = _parent(model, body)
        if chain[1].kind != "hinge":
            return {}
        found.append(chain)
    return {role: tuple(chain[i].name for chain in found) for i, role in enumerate(roles)}


def _toes(model: Model, feet: tuple[str, ...], listed: list[str]) -> tuple[str, ...]:
    """The hinge behind each foot that moves a body which is listed with it; empty unless each has one."""
    found = []
    for foot in feet:
        behind = [joint for name in listed if _parent(model, name) == foot for joint in _joints(model, name)]
        found += [joint.name for joint in behind if joint.kind == "hinge"][:1]
    return tuple(found) if len(found) == len(feet) else ()


def _knuckles(model: Model, hands: tuple[str, ...], listed: list[str]) -> tuple[tuple[str, ...], ...]:
    """The listed bodies by the hand that they hang on; empty unless each hand has three."""
    found = tuple(tuple(name for name in listed if _parent(model, name) == hand) for hand in hands)
    return found if all(len(names) == 3 for names in found) else ()
