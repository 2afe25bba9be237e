"""Which joint of a recorded skeleton is which part of a person, told by its name.

Knows the names of CMU (BVH and ASF), BallPlay-M, Mixamo, LAFAN and most plain `LeftUpLeg` / `l_thigh` styles.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ..trees import below, path
from .names import bare

PARTS = {
    "hip": ("upleg", "upperleg", "thigh", "femur", "hip"),
    "knee": ("leg", "lowerleg", "shin", "calf", "tibia", "knee"),
    "ankle": ("foot", "ankle"),
    "toe": ("toebase", "toe", "toes", "ball"),
    "shoulder": ("arm", "upperarm", "uparm", "humerus", "shoulder"),
    "elbow": ("forearm", "lowerarm", "radius", "elbow"),
    "wrist": ("fingerbase", "hand", "wrist"),
}
"""Part -> its names, the first that a skeleton has is it: CMU's `LeftHand` begins below the elbow, so
its `LeftFingerBase` goes before; a `Shoulder` beside an `Arm` is a collar bone."""
SIDES = ("left", "right")


def parts(names: Sequence[str], parents: np.ndarray) -> dict[str, int]:
    """The joints found: "head", and for each side "left_hip", "left_knee", "left_ankle", "left_toe",
    "left_shoulder", "left_elbow", "left_wrist", and the tips of the toes and of the longest fingers,
    "left_toe_tip", "left_hand". A part that no name tells is not in it."""
    found: dict[str, int] = {}
    plain = [_plain(name) for name in bare(names)]
    for side in SIDES:
        for part, words in PARTS.items():
            joint = next((plain.index((side, w)) for w in words if (side, w) in plain), None)
            if joint is not None:
                found[f"{side}_{part}"] = joint
        if f"{side}_wrist" in found:
            found[f"{side}_hand"] = _finger_tip(names, parents, found[f"{side}_wrist"])
        if f"{side}_toe" in found:
            toe = found[f"{side}_toe"]
            found[f"{side}_toe_tip"] = _farthest(names, parents, toe, below(parents, toe))
    if ("", "head") in plain:
        found["head"] = plain.index(("", "head"))
    return found


def leftward(found: dict[str, int], places: np.ndarray) -> np.ndarray | None:
    """Unit vector (..., 3) from the right hip (else shoulder) to the left one, joint places (..., joints, 3);
    None when the skeleton does not tell."""
    for part in ("hip", "shoulder"):
        pair = [found.get(f"{side}_{part}") for side in SIDES]
        if None not in pair:
            across = places[..., pair[0], :] - places[..., pair[1], :]
            return across / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
    return None


def _plain(name: str) -> tuple[str, str]:
    """(side, word) of a joint's bare name: 'LeftUpLeg' and 'l_upleg' are ('left', 'upleg')."""
    short = re.match(r"^([lLrR])[_.\- ]|.*[_.\- ]([lLrR])$", name)
    word = re.sub(r"[^a-z0-9]", "", name.lower())
    for side in SIDES:
        if side in word:
            return side, word.replace(side, "", 1)
    if short:
        side = "left" if (short[1] or short[2]).lower() == "l" else "right"
        return side, word[1:] if short[1] else word[:-1]
    known = {w for words in PARTS.values() for w in words}
    if word[:1] in ("l", "r") and word[1:] in known and word not in known:
        return ("left" if word[0] == "l" else "right"), word[1:]
    return "", word


def _finger_tip(names: Sequence[str], parents: np.ndarray, wrist: int) -> int:
    """The end of the middle finger, else of the index finger, else of any that is no thumb."""
    hand = below(parents, wrist)
    for word in ("middle", "index", ""):
        chain = [j for j in hand if word in names[j].lower() and "thumb" not in names[j].lower()]
        if chain:
            return _farthest(names, parents, wrist, chain)
    return wrist


def _farthest(names: Sequence[str], parents: np.ndarray, top: int, joints: list[int]) -> int:
    """The joint with most joints between it and `top`; the same one in whatever order a file has them."""
    return max(joints, key=lambda j: (len(path(parents, top, j)), names[j]))
