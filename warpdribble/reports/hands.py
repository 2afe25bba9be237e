"""The figures of docs/dribbling.md on what hands are made of: gains of wrists and fingers, contact of hand
and ball, the forearm's end, each changed alone in the player's file, while cycles of a skill are optimised.

    python -m warpdribble.reports.hands OUT.json [RUN ...] [--set NAME=VALUE,...] [--draw PICTURE.png]

RUN: folders with legs (the stage `locomotion`) of skills that have a ball, or shipped controllers; by default
the dribble that ships. Each is a catch and a push, `CYCLES` times in a row by Gauss-Newton steps, from
`SEEDS` starts that differ by a few millimetres and mm/s. What OUT.json has already is not measured again.
"""

from __future__ import annotations

import argparse
import json
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..assets import path as asset
from ..assets.player import BALL_MASS
from ..learning.ball.newton import Newton, NewtonConfig, sizes
from ..learning.ball.optimised import Optimised, Playback
from ..learning.ball.windows import Moment
from ..learning.evaluate.record import record
from ..learning.graph import STEPS
from ..learning.methods import STAGES
from ..learning.runs.folder import Run
from ..learning.starts import Starts
from ..learning.tasks.arms import Arms
from ..learning.tasks.fingers import finger_joints
from ..sims import Model
from ..sims.reference import Reference
from ..sims.signals import runs as stretches
from ..sims.trajectory import Trajectory
from .motion import shake

CYCLES, SEEDS = 2, 3
PLACE, SPEED = 0.003, 0.05
"""[m] [rad/s, m/s] Standard deviations of a start: of the ball's place, of all velocities."""
STIFF = float("inf")


@dataclass(frozen=True)
class Setting:
    """What is changed in the player's file; by default what it has."""

    wrist: float = 1.0
    """what its kp and kv are multiplied by; the limit of the torque stays"""
    fingers: float = 1.0
    """likewise"""
    friction: float = 0.8
    """of hand and ball"""
    restitution: float = 0.0
    """of hand and ball"""
    spring: float = STIFF
    """[N/m] of a point of the hand that gives way, critically damped with the ball on it"""
    forearm: float = 0.027
    """[m] radius of the forearm's thin half"""
    heel: float = 0.0
    """[m] radius of a bar across the palm's base; 0: none"""


PRESENT = Setting()
SWEEP: dict[str, tuple[float, ...]] = {
    "wrist": (0.25, 0.5, 1.0, 2.0, 4.0),
    "fingers": (0.25, 0.5, 1.0, 2.0, 4.0),
    "friction": (0.4, 0.6, 0.8, 1.0, 1.2),
    "restitution": (0.0, 0.2, 0.5),
    "spring": (20e3, 40e3, STIFF),
    "forearm": (0.016, 0.020, 0.027),
    "heel": (0.0, 0.020),
}
FINGER_CLASSES = ("mcp", "pip", "dip")


def edited(setting: Setting) -> Model:
    """The player with a setting in place of what its file says."""
    tree = ET.parse(asset("player.xml"))
    root = tree.getroot()

    def find(where: str) -> ET.Element:
        found = root.find(where)
        assert found is not None, where
        return found

    for names, factor in ((("wrist",), setting.wrist), (FINGER_CLASSES, setting.fingers)):
        for name in names:
            drive = find(f".//default[@class='{name}']/position")
            for gain in ("kp", "kv"):
                drive.set(gain, f"{factor * float(drive.attrib[gain]):g}")
    ball = find(".//geom[@name='ball']")
    bounce, erp, cfm = map(float, ball.attrib["user"].split())
    if np.isfinite(setting.spring):  # as the soles': a contact has the mean of both geoms'
        step = float(find("option").attrib["timestep"])
        load = step * setting.spring + 2.0 * np.sqrt(setting.spring * BALL_MASS)
        own_erp, own_cfm = 2.0 * step * setting.spring / load - erp, 2.0 / load - cfm
    else:
        own_erp, own_cfm = erp, cfm
    friction = f"{setting.friction:g} 0.005 0.0001"
    if setting.friction < PRESENT.friction:  # of two the larger counts; the ground keeps its own
        ball.set("friction", friction)
    for hand in find("custom/text[@name='hands']").attrib["data"].split():
        for geom in find(f".//body[@name='{hand}']").findall("geom"):
            geom.set("friction", friction)
            geom.set("user", f"{setting.restitution / bounce:.9g} {own_erp:.9g} {own_cfm:.9g}")
    for side in "lr":
        find(f".//geom[@name='{side}_lower_arm_b']").set("size", f"{setting.forearm:g}")
        if setting.heel:
            palm = find(f".//body[@name='{side}_hand']")
            x, y = 0.02, 0.012 if side == "l" else -0.012
            bar = dict(find(f".//geom[@name='{side}_hand']").attrib)
            bar |= {"name": f"{side}_heel", "type": "capsule", "size": f"{setting.heel:g}"}
            bar |= {"fromto": f"{-x} {y} 0 {x} {y} 0"}
            del bar["pos"]
            ET.SubElement(palm, "geom", bar)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "player.xml"
        tree.write(path, encoding="utf-8")
        return Model.load(path)


@dataclass(frozen=True)
class Held:
    """What was found from one start."""

    cycles: int
    """found, of CYCLES"""
    fingers: float
    """[cm] mean distance from the ball in H (Eq. 7)"""
    wander: float
    """[cm] root mean square distance of the ball's place on the palm from its mean, hold by hold"""
    offsets: float
    """[rad] mean length of the offsets chi of the arms that act"""
    twitch: float
    """[rad/s^2] root mean square of wrists' and fingers' acceleration between 5 and 30 Hz"""
    reference: float
    """the same of the reference"""
    rounds: float
    """batches of candidates that a cycle took"""


def measured(run: Run, setting: Setting, seed: int) -> Held:
    """A few cycles of a run's skill, from one start."""
    model, graph = edited(setting), run.graph
    legs = run.learned(STAGES, "locomotion").controller
    config = NewtonConfig()
    few, steps, slopes = (Arms(model, graph, n, legs, closely=True) for n in sizes(model, graph, config))
    learner = Newton(few, steps, slopes, config, CYCLES, searches=False)
    learner.begin = beside(few, learner.begin, np.random.default_rng(seed))
    while not learner.done:
        learner.iterate()
    windows = len(learner.windows)
    cycles = learner.iteration // windows
    if learner.result is None or not cycles:
        return Held(0, np.nan, np.nan, np.nan, np.nan, np.nan, float(learner.rounds))
    found = Optimised.of(learner.result)
    found = Optimised(*(part[: cycles * graph.cycle] for part in vars(found).values()))
    first = Starts(found.k[:1], found.joint_q[:1], found.joint_qd[:1])
    task = Arms(model, graph, 1, legs)
    seen = record(task, Playback(found), first, len(found))[0]
    acts = task.active[found.k].reshape(len(found), 2, -1)[:, :, 0].any(axis=0)
    own, theirs = (twitch(model, q, seen.timestep, acts) for q in (seen.joint_q, seen.reference_q))
    return Held(
        cycles,
        fingers=100.0 * float(found.distance(graph.cycle).mean()),
        wander=100.0 * wander(model, seen, held_rows(graph.touch, found.k)),
        offsets=float(found.offsets(task.active[found.k]).mean()),
        twitch=own,
        reference=theirs,
        rounds=learner.rounds / (learner.iteration / windows),
    )


def beside(task: Arms, begin: Moment, random: np.random.Generator) -> Moment:
    """A moment a little off another one."""
    starts = begin.starts(task.worlds)
    ball = task.model.q_slice(task.model.roles.one("ball_joint")).start
    joint_q, joint_qd = starts.joint_q.copy(), starts.joint_qd.copy()
    joint_q[:, ball : ball + 3] += PLACE * random.standard_normal(3)
    joint_qd += SPEED * random.standard_normal(joint_qd.shape[1])
    task.reset(Starts(starts.k, joint_q, joint_qd))
    return Moment.of(task, begin.k)


def held_rows(touch: Any, k: np.ndarray) -> np.ndarray:
    """(STEPS * fragments + 1, 2) bool: the rows of a recording of fragments k in which each hand should have
    the ball."""
    rows = np.asarray(touch, bool).reshape(-1, STEPS, 2)[k].reshape(-1, 2)
    return np.concatenate([rows[:1], rows])


def wander(model: Model, seen: Trajectory, held: np.ndarray) -> float:
    """[m] root mean square distance of the ball's place on a palm from its mean over a hold; held (rows, 2).
    How much of it is slip and how much the ball rolls is not told."""
    at = seen.body_q[:, model.body(model.roles.one("ball")), :3]
    off = []
    for hand, name in enumerate(model.roles.both("palms")):
        body, place, turn = model.sites[name]
        pose = Rotation.from_quat(seen.body_q[:, body, 3:])
        palm = seen.body_q[:, body, :3] + pose.apply(place)
        on = (pose * Rotation.from_quat(turn)).inv().apply(at - palm)[:, :2]
        for first, last in stretches(held[:, hand]):
            own = on[first : last + 1]
            off.append(np.sum((own - own.mean(axis=0)) ** 2, axis=1))
    return float(np.sqrt(np.mean(np.concatenate(off))))


def twitch(model: Model, joint_q: np.ndarray, timestep: float, acts: np.ndarray) -> float:
    """[rad/s^2] root mean square of the acceleration between 5 and 30 Hz of the wrists and fingers of the
    hands that act (2,)."""
    rates = Reference(joint_q, timestep).velocity(model)
    names = [
        name
        for hand, (wrist, own) in enumerate(zip(model.roles.both("wrists"), finger_joints(model)))
        if acts[hand]
        for name in (wrist, *own)
    ]
    return shake(np.concatenate([rates[:, model.dof_slice(name)].T for name in names]), 1.0 / timestep)


# ---------------------------------------------------------------------------------------------- sweep


def settings() -> Iterator[Setting]:
    """What is there, and each value alone in its place."""
    yield PRESENT
    for name, values in SWEEP.items():
        for value in values:
            if (one := replace(PRESENT, **{name: value})) != PRESENT:
                yield one


Rows = list[dict[str, Any]]


def sweep(folders: list[str], out: Path, some: list[Setting]) -> Rows:
    """All of `some` for each run from each start, beside what was measured before."""
    rows: Rows = json.loads(out.read_text()) if out.exists() else []
    for folder in folders:
        run = Run.load(folder)
        skill = run.info["skill"]["name"]
        for seed, setting in product(range(SEEDS), some):
            own = {"skill": skill, "seed": seed, "setting": asdict(setting)}
            if any(all(row[key] == own[key] for key in own) for row in rows):
                continue
            rows.append(own | asdict(measured(run, setting, seed)))
            out.write_text(json.dumps(rows))
            print(rows[-1], flush=True)
    return rows


# ---------------------------------------------------------------------------------------------- tables

SAID = {
    "wrist": ("wrists' gains", "x {:g}"),
    "fingers": ("fingers' gains", "x {:g}"),
    "friction": ("friction", "{:g}"),
    "restitution": ("restitution", "{:g}"),
    "spring": ("spring [kN/m]", "{:g}"),
    "forearm": ("forearm's radius [mm]", "{:g}"),
    "heel": ("heel's radius [mm]", "{:g}"),
}
SCALE = {"spring": 1e-3, "forearm": 1e3, "heel": 1e3}
"""From a setting's unit to that of its name."""
COLUMNS = ("fingers", "wander", "offsets", "twitch", "rounds")


def said(name: str, value: float) -> str:
    """A value as tables and pictures have it."""
    if name == "spring" and not np.isfinite(value):
        return "stiff"
    return SAID[name][1].format(value * SCALE.get(name, 1.0))


def changes(setting: dict[str, float]) -> list[str]:
    """What is not as in the file."""
    return [
        f"{SAID[name][0]} {said(name, value)}"
        for name, value in setting.items()
        if value != getattr(PRESENT, name)
    ]


def chosen(rows: Rows, skill: str, setting: Setting) -> Rows:
    """The starts of a skill with a setting."""
    return [row for row in rows if row["skill"] == skill and row["setting"] == asdict(setting)]


def table(rows: Rows) -> str:
    """As Markdown: medians of the starts, and the least and the most."""
    lines = [
        "| skill | changed | cycles found | fingers [cm] | wander [cm] | offsets [rad] | twitch [rad/s^2] "
        "| batches a cycle |",
        "|---|---|---:|---:|---:|---:|---:|---:|",
    ]
    for skill in dict.fromkeys(row["skill"] for row in rows):
        there = {json.dumps(row["setting"]): row["setting"] for row in rows if row["skill"] == skill}
        for setting in there.values():
            some = chosen(rows, skill, Setting(**setting))
            cells = [
                skill,
                ", ".join(changes(setting)) or "nothing",
                f"{sum(row['cycles'] for row in some)} of {CYCLES * len(some)}",
            ]
            for name, digits in zip(COLUMNS, (2, 1, 2, 0, 0)):
                values = [row[name] for row in some if np.isfinite(row[name])]
                numbers = [f"{f(values):.{digits}f}" for f in (np.median, np.min, np.max)] if values else []
                cells.append(f"{numbers[0]} ({numbers[1]} - {numbers[2]})" if numbers else "-")
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def draw(rows: Rows, skill: str, out: Path) -> None:
    """A column for each thing that was changed, a row for each measure: starts as dots, their medians as a
    line, what the file has as a band."""
    from matplotlib.figure import Figure

    from ..takes.sheet import save

    measures = {
        "fingers": "fingers [cm]",
        "wander": "wander [cm]",
        "offsets": "offsets [rad]",
        "twitch": "twitch [rad/s²]",
    }
    figure = Figure(figsize=(11.0, 6.0), dpi=100, layout="constrained")
    widths = [len(values) + 0.5 for values in SWEEP.values()]
    axes = figure.subplots(len(measures), len(SWEEP), sharey="row", sharex="col", width_ratios=widths)
    here = chosen(rows, skill, PRESENT)
    for line, (measure, label) in zip(axes, measures.items()):
        line[0].set_ylabel(label, fontsize=9)
        known = [row[measure] for row in here]
        for ax, (name, values) in zip(line, SWEEP.items()):
            ax.axhspan(min(known), max(known), color="C0", alpha=0.15, lw=0)
            medians = []
            for i, value in enumerate(values):
                some = [row[measure] for row in chosen(rows, skill, replace(PRESENT, **{name: value}))]
                own = value == getattr(PRESENT, name)
                ax.plot([i] * len(some), some, "o", ms=4, color="C0" if own else "C1")
                medians.append(np.nanmedian(some) if some else np.nan)
            ax.plot(medians, "-", lw=1, color="0.5", zorder=0)
            ax.set_xticks(range(len(values)), [said(name, v).removeprefix("x ") for v in values])
            ax.set_xlim(-0.5, len(values) - 0.5)
            ax.tick_params(labelsize=8)
            ax.grid(alpha=0.3)
    for line, measure in zip(axes, measures):
        known = [row[measure] for row in rows if row["skill"] == skill]
        line[0].set_ylim(0.0, 1.08 * np.nanmax(known))
    for ax, name in zip(axes[0], SWEEP):
        ax.set_title(SAID[name][0].replace(" [", "\n["), fontsize=9)
    save(figure, "Each changed alone; blue: as the player's file has it", out)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("out", type=Path, help="what is measured is kept here")
    parser.add_argument("runs", nargs="*", default=["dribble-right-authored"], help="folders with legs")
    parser.add_argument("--set", default="", help="instead of the sweep: present, or NAME=VALUE,NAME=VALUE")
    parser.add_argument("--draw", type=Path, help="a picture of the first run's sweep")
    asked = parser.parse_args()
    some = list(settings())
    if asked.set:
        pairs = [pair.split("=") for pair in asked.set.split(",") if "=" in pair]
        some = [replace(PRESENT, **{name: float(value) for name, value in pairs})]
    rows = sweep(asked.runs, asked.out, some)
    print(table(rows))
    if asked.draw:
        draw(rows, Run.load(asked.runs[0]).info["skill"]["name"], asked.draw)


if __name__ == "__main__":
    main()
