"""What a simulated run leaves: the take, the pictures and the replay beside it, and what is said of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from .console import say


@dataclass(kw_only=True)
class Outputs:
    """Options of every command that writes a take."""

    out: Path = Path("out/take.usdc")
    """The take: .usda, .usdc or .usdz. The pictures (.png) and the replay (.html) go beside it."""
    skin: bool = False
    """One smooth body over the player, in the take and the replay, instead of its shapes."""
    usd_joints: Literal["revolute", "d6", "spherical"] = "revolute"
    """How ball joints are said in USD: revolute for MuJoCo and Newton, d6 for Omniverse and Isaac."""
    html: bool = True
    """Write the replay, a page for any browser, beside the take."""
    device: str = "cpu"
    """Where to simulate: cpu, cuda:0, ..."""


def check_outputs(out: Path) -> None:
    """Raise ValueError where the take or what goes beside it cannot be written."""
    from ..takes.take import check_writable

    check_writable(out)
    for other in (".png", ".plots.png", ".html"):
        check_writable(out.with_suffix(other), (".png", ".html"))


def write_outputs(command: Outputs, model, run, source: str, root: str) -> None:
    """Write all of it and say where. run: a `simulate.Run`; source: where the motion comes from; root: what
    holds the root."""
    from .. import __version__
    from ..takes.plots import write_plots
    from ..takes.sheet import write_sheet
    from ..takes.take import Take, validate, write_take
    from ..web.page import write_replay

    take = Take.of(
        model,
        run.body_q,
        fps=1.0 / model.timestep,
        notes={"creator": f"warpdribble {__version__}", "clip": source, "root": root},
    )
    heights = {
        label: run.body_q[:, model.body(body), 2]
        for label, body in (("right hand", "r_hand"), ("left hand", "l_hand"))
        if body in model.body_names
    }
    picture = command.out.with_suffix(".png")
    plots, replay = command.out.with_suffix(".plots.png"), command.out.with_suffix(".html")
    title = f"{source}, root {root}"
    write_take(command.out, take, skin=command.skin, joints=command.usd_joints)
    write_sheet(picture, take, heights, run.contacts, title)
    roots = run.root_paths(model)
    write_plots(plots, take.fps, *roots, run.angle_error, run.position_error, run.fallen, title)
    if command.html:
        write_replay(replay, take, run.contacts, title, skin=command.skin)
    errors = validate(command.out)
    state = "valid USD" if not errors else f"USD validation: {'; '.join(errors)}"
    say(f"take      {command.out} ({len(take.body_q)} frames at {take.fps:g} fps, {state})")
    say(f"pictures  {picture}, {plots.name}")
    if command.html:
        say(f"replay    {replay} (open it in a browser)")


def say_run(run, root: str) -> None:
    """Say how it went."""
    import numpy as np

    fell = f", first at {run.fallen.argmax() * run.reference.timestep:.2f} s" if run.falls else ""
    say(f"simulated {run.reference.duration:.2f} s with root {root}, {run.real_time_factor:.1f} x real time")
    say(
        f"tracking  joints {np.degrees(run.angle_error.mean()):.1f} degrees, "
        f"bodies {100.0 * run.position_error.mean():.1f} cm off (means, fingers left out)"
    )
    say(f"falls     {run.falls}{fell}")
    if "ball on ground" in run.contacts:
        ground = run.contacts["ball on ground"]
        bounces = int(np.sum(ground[1:] & ~ground[:-1]))
        say(f"ball      {bounces} bounces (put in play, not yet controlled)")
