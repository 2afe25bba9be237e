"""How motion looks that was put on the player, over all recordings of a folder: a table of the worst clips.

    python -m warpdribble.reports.motion FOLDER

puts every clip below FOLDER on the player and prints Markdown: a line per measure, with its median, its 90th
percentile, and the worst clip. A further measure is a function of a `Case` in MEASURES.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from ..clips.read import SUFFIXES, read_clip
from ..learning.evaluate.attempts import follow, starts
from ..learning.evaluate.record import record
from ..learning.evaluate.tracking import Limb, track
from ..learning.tasks.follow import OpenLoop
from ..sims import Model
from ..sims.model import pose
from ..sims.recording import anatomy
from ..sims.recording.motion import Motion
from ..sims.retarget.accuracy import Accuracy, accuracy
from ..sims.retarget.retarget import Retargeted, retargeted
from ..sims.retarget.sole import Foot, find_foot

SHAKE = (5.0, 30.0)
"""[Hz] Faster than people move their knees, slower than what a frame rate of 60 Hz shows."""
BARE = cache(lambda: Model.load("player", without=("ball",)))
ENDS = 5
"""Rows at either end that a filter spoils."""


@dataclass(frozen=True)
class Case:
    """A clip on the player."""

    model: Model
    motion: Motion
    """At the player's rate."""
    result: Retargeted

    @cached_property
    def copied(self) -> Retargeted:
        """With rotations copied only."""
        return retargeted(self.model, self.motion, self.result.mapping, ik=False)

    @cached_property
    def fit(self) -> Accuracy:
        return accuracy(self.model, self.result)

    @cached_property
    def body_q(self) -> np.ndarray:
        return pose.forward(self.model, self.result.reference.joint_q)

    @cached_property
    def tracked(self) -> list[Limb]:
        """The feet, simulated without the ball while the root is held to the clip."""
        bare, reference = BARE(), self.result.reference
        reference = replace(reference, joint_q=bare.convert_q(self.model, reference.joint_q))
        task = follow(bare, reference, 1, "tracked")
        begin = starts(bare, reference, 1, ball=False)
        seen = record(task, OpenLoop(), begin, task.graph.count)[0].first(reference.frame_count)
        return [limb for limb in track(bare, seen).limbs if limb.name in bare.roles.feet]

    def angle(self, joint: str, copied: bool = False) -> np.ndarray:
        """(frames,) [rad] of a hinge."""
        result = self.copied if copied else self.result
        return result.reference.joint_q[:, self.model.q_slice(joint)][:, 0]

    def swings(self) -> list[tuple[Foot, int, np.ndarray, np.ndarray]]:
        """Of each foot that steps in the clip and whose toes were recorded: the foot, its recorded toe, in
        which rows (frames,) it stands, and in which it is between two stands."""
        found = anatomy.parts(self.motion.joint_names, self.motion.parents)
        out = []
        for name, stands in self.result.stands.items():
            side = {"l": "left", "r": "right"}[name[0]]
            if len(stands) < 2 or f"{side}_toe" not in found:
                continue
            stood = np.zeros(len(self.body_q), bool)
            for stand in stands:
                stood[stand.first : stand.last + 1] = True
            swings = ~stood
            swings[: stands[0].first] = swings[stands[-1].last :] = False
            if swings.any():
                out.append((find_foot(self.model, name), found[f"{side}_toe"], stood, swings))
        return out


def skimming(case: Case) -> float:
    return 100.0 * case.fit.skimming


def lower(case: Case) -> float | None:
    """[cm] 95th percentile of how much lower the ball of a swinging foot is than the recorded one."""
    return _quantile(-_clearance(case))


def higher(case: Case) -> float | None:
    """[cm] The same of how much higher it is."""
    return _quantile(_clearance(case))


def _clearance(case: Case) -> np.ndarray:
    """(n,) [cm] by which the ball of a swinging foot is higher than the recorded one, both measured from
    where they are while it stands, between the stands before and after."""
    heights = case.result.scale * case.motion.places()[..., 2] - case.result.ground[:, None]
    errors = [np.zeros(0)]
    for foot, toe, stood, swings in case.swings():
        own = case.body_q[:, foot.toes, 2] - foot.drop
        low = stood & (own < 0.002)
        if low.any():
            errors.append((own - heights[:, toe] - _steadied(own - heights[:, toe], low))[swings])
    return 100.0 * np.concatenate(errors)


def _quantile(errors: np.ndarray) -> float | None:
    return float(np.quantile(np.maximum(errors, 0.0), 0.95)) if len(errors) else None


def _steadied(off: np.ndarray, low: np.ndarray) -> np.ndarray:
    """Values (frames,) with each stretch of `low` (frames,) bool at its median, straight lines between."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], low.astype(int), [0]])))
    spans = edges.reshape(-1, 2)
    middles = spans.mean(axis=1) - 0.5
    return np.interp(np.arange(len(off)), middles, [np.median(off[a:b]) for a, b in spans])


def toes(case: Case) -> float | None:
    """[deg] 95th percentile of how far the toes of a swinging foot are bent from the recorded, both less
    their median while it stands flat."""
    frames, rest = case.motion.forward()[1], case.motion.rest()[1]
    errors = []
    for foot, toe, stood, swings in case.swings():
        turns = []
        for joint in (case.motion.parents[toe], toe):
            turns.append(Rotation.from_quat(frames[:, joint]) * Rotation.from_quat(rest[joint]).inv())
        theirs = pose.twist(turns[0].inv() * turns[1], case.model.joint_axis(foot.toe_joint))
        ours = case.angle(foot.toe_joint)
        flat = stood & (np.abs(ours) < np.radians(2.0))
        if flat.any():
            error = ours - theirs - np.median((ours - theirs)[flat])
            errors.append(np.abs(error[swings]))
    return float(np.degrees(np.quantile(np.concatenate(errors), 0.95))) if errors else None


def shake(speeds: np.ndarray, rate: float) -> float:
    """Root mean square of the acceleration between 5 and 30 Hz of speeds (n, frames) at `rate` [Hz]."""
    band = butter(2, SHAKE, btype="band", fs=rate, output="sos")
    faster = np.gradient(speeds, axis=1) * rate
    return float(np.sqrt(np.mean(sosfiltfilt(band, faster, axis=1)[:, ENDS:-ENDS] ** 2)))


def knees(case: Case) -> float | None:
    """[-] root mean square of the knees' acceleration between 5 and 30 Hz over the copied rotations'."""
    rate = 1.0 / case.model.timestep
    if len(case.body_q) < 40:
        return None

    def accelerates(copied: bool) -> float:
        angles = np.stack([case.angle(knee, copied) for knee in case.result.mapping.legs])
        return shake(rate * np.gradient(angles, axis=1), rate)

    return accelerates(False) / max(accelerates(True), 1e-9)


def hands(case: Case) -> float:
    """[deg] by which a hand turns at most from one row to the next."""
    turns = [Rotation.from_quat(case.body_q[:, case.model.body(h), 3:]) for h in case.model.roles.hands]
    return float(np.degrees(max((t[:-1].inv() * t[1:]).magnitude().max() for t in turns)))


def sliding(case: Case) -> float:
    return 1000.0 * case.fit.sliding


def joints(case: Case) -> float:
    return 100.0 * case.fit.mean


def tracked_feet(case: Case) -> float:
    return 100.0 * max(limb.far for limb in case.tracked)


def tracked_worst(case: Case) -> float:
    return 100.0 * max(limb.worst for limb in case.tracked)


def tracked_sliding(case: Case) -> float | None:
    known = [100.0 * limb.sliding for limb in case.tracked if np.isfinite(limb.sliding)]
    return max(known) if known else None


MEASURES: dict[str, Callable[[Case], float | None]] = {
    "rows in which a foot skims the ground, %": skimming,
    "swinging feet lower than recorded, 95 %, cm": lower,
    "swinging feet higher than recorded, 95 %, cm": higher,
    "toes of swinging feet, 95 %, off by degrees": toes,
    "knee acceleration, 5 to 30 Hz, times the copied": knees,
    "a hand turns in 10 ms, at most, degrees": hands,
    "standing feet slide, mm/s": sliding,
    "mean joint error, cm": joints,
    "tracked: feet off the reference, 95 %, cm": tracked_feet,
    "tracked: feet off the reference, at worst, cm": tracked_worst,
    "tracked: standing feet slide, 95 %, cm/s": tracked_sliding,
}


def measure(model: Model, folder: Path) -> dict[str, dict[str, float]]:
    """Measure -> clip -> value; a clip that does not show it is left out."""
    found: dict[str, dict[str, float]] = {what: {} for what in MEASURES}
    for path in sorted(p for p in folder.rglob("*") if p.suffix.lower() in SUFFIXES):
        motion, _ = read_clip(path)
        case = Case(model, motion.resample(1.0 / model.timestep), retargeted(model, motion))
        for what, function in MEASURES.items():
            value = function(case)
            if value is not None:
                found[what][path.relative_to(folder).as_posix()] = value
    return found


def table(found: dict[str, dict[str, float]]) -> str:
    """Markdown: a line per measure."""
    lines = ["| measure | clips | median | 90 % | worst |", "|---|---:|---:|---:|---|"]
    for what, values in found.items():
        if values:
            worst = max(values, key=lambda clip: values[clip])
            middle, high = np.quantile(list(values.values()), (0.5, 0.9))
            numbers = f"{len(values)} | {middle:.2f} | {high:.2f} | {values[worst]:.2f} ({worst})"
            lines.append(f"| {what} | {numbers} |")
    return "\n".join(lines)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit("usage: python -m warpdribble.reports.motion FOLDER")
    print(table(measure(Model.load("player"), Path(sys.argv[1]))))
