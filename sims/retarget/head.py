"""A recorded neck of several joints on a player who has one: the head is where the recording has it.

People who lean or run bend the lower neck forward and the upper one back. Copied to a rigid neck and head,
the last joint's rotation alone would tip all of it back, chin up, behind where it was recorded.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from ..model import Model
from ..recording.motion import Motion
from ..trees import below, path
from .calibrate import shortest
from .mapping import Mapping

UPRIGHT = np.cos(np.radians(30.0))
"""In a T-pose the crown is above the neck; a line farther off leads elsewhere."""
TOLD = 10.0
"""[degrees] A line that turns the head this much on average is said."""


def along_neck(
    model: Model,
    motion: Motion,
    mapping: Mapping,
    positions: np.ndarray,
    since: Callable[[str], Rotation],
) -> Rotation | None:
    """World rotation (frames,) of the head since the T-pose: along the line from the neck's first joint, the
    next above the trunk's, to the crown, and about that line as the head's joint.

    positions: (frames, joints, 3) [m]; since: of `since_rest`. None where the recording has no end of the
    head, or no joint of the neck below it: then the head's joint says all that is known.
    """
    head, trunk = (mapping.bodies.get(str(body)) for body in (model.roles.head, model.roles.trunk))
    if head is None or trunk is None:
        return None
    top = motion.index(head)
    neck = path(motion.parents, motion.index(trunk), top)[1:]
    tips = below(motion.parents, top)[1:]
    if len(neck) < 2 or not tips:
        return None
    rest, _ = motion.rest()
    lines = rest[tips] - rest[neck[0]]
    crown = int(np.argmax(lines[:, 2]))
    line = lines[crown]
    if line[2] < UPRIGHT * np.linalg.norm(line):
        return None
    turn = since(head)
    now = turn.inv().apply(positions[:, tips[crown]] - positions[:, neck[0]])
    return turn * shortest(now, line).inv()


def told(own: Rotation, line: Rotation) -> tuple[str, ...]:
    """What to say where the head's joint alone would have had the head far from its line."""
    apart = float(np.degrees((own.inv() * line).magnitude()).mean())
    if apart < TOLD:
        return ()
    return (f"the head goes with the line from neck to crown, {apart:.0f} degrees from its joint's own turn",)
