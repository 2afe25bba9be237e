"""What a simulated run leaves: the take, the pictures and the replay beside it, and what is said of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from .console import bar, check_new, say

if TYPE_CHECKING:
    from ..learning.evaluate.tracking import Tracking
    from ..sims import Model
    from ..sims.trajectory import Trajectory


@dataclass(kw_only=True)
class Outputs:
    """Options of every command that writes a take."""

    out: Path = Path("out/take.usdc")
    """The take: .usda, .usdc or .usdz. The pictures (.png) and the replay (.html) go beside it."""
    skin: bool = True
    """The player as one smooth body, in the take and the replay; --no-skin shows the shapes that are
    simulated, which is how a model of your own is shown."""
    usd_joints: Literal["revolute", "d6", "spherical"] = "revolute"
    """How ball joints are said in USD: revolute for MuJoCo and Newton, d6 for Omniverse and Isaac."""
    film: Path | None = None
    """Write a film, too: an animated .webp or .gif, which any page shows; half a second of a core for each
    of 20 frames a second."""
    html: bool = True
    """Write the replay, a page for any browser, beside the take."""
    overwrite: bool = False
    """Replace files that are there; they are left alone otherwise."""
    device: str = "cpu"
    """Where to simulate: cpu, cuda:0, ..."""


def check_outputs(command: Outputs) -> None:
    """Raise ValueError where the take or what goes beside it cannot be written, or is there already."""
    from ..takes import film
    from ..takes.take import check_writable, layer_files

    out = check_writable(command.out)
    beside = [out.with_suffix(s) for s in (".png", ".plots.png", *([".html"] if command.html else []))]
    for other in beside:
        check_writable(other, (".png", ".html"))
    if command.film is not None:
        beside.append(check_writable(command.film, film.SUFFIXES))
    layers = layer_files(out).values() if out.suffix == ".usda" else ()
    check_new([out, *layers, *beside], command.overwrite)


def write_outputs(
    command: Outputs, model: Model, seen: Trajectory, source: str, root: str, cycles: float | None = None
) -> None:
    """Say how it went, write all of it, moved to the middle of the court, and say where. source: where the
    motion comes from; root: what holds the root; cycles: so many of them a policy tried to keep the ball."""
    from concurrent.futures import ThreadPoolExecutor

    from .. import __version__
    from ..sims.trajectory import centred
    from ..skin import skin as skins
    from ..skin.flesh import is_player
    from ..takes import Take, validate, write_film, write_plots, write_sheet, write_take
    from ..takes.film import frame_count
    from ..takes.usdjoints import left_out
    from ..web import write_replay

    skin = command.skin and is_player(model)
    seen = centred(model, seen)
    tracking = say_trajectory(model, seen, root, cycles)
    take = Take.of(
        model,
        seen.body_q.astype(float),
        fps=1.0 / model.timestep,
        notes={"creator": f"warpdribble {__version__}", "clip": source, "root": root},
        reference=tracking.wanted,
    )
    hands = zip(("right hand", "left hand"), model.roles.hands[::-1])
    heights = {label: seen.body_q[:, model.body(body), 2] for label, body in hands}
    picture = command.out.with_suffix(".png")
    plots, replay = command.out.with_suffix(".plots.png"), command.out.with_suffix(".html")
    title = f"{source}, root {root}"
    if skin:
        skins.of(model)  # made once, for both threads
    with ThreadPoolExecutor(1) as beside:  # rays are cast outside Python, while the take is written
        drawn = beside.submit(write_sheet, picture, take, heights, tracking.contacts, title, skin)
        write_take(command.out, take, skin=skin, joints=command.usd_joints)
        if command.html:
            write_replay(replay, take, tracking.contacts, title, skin=skin)
        drawn.result()
    write_plots(
        plots,
        take.fps,
        tracking.root,
        tracking.wanted_root,
        tracking.angle_error,
        tracking.position_error,
        tracking.fallen,
        title,
    )
    errors = validate(command.out)
    state = "valid USD" if not errors else f"USD validation: {'; '.join(errors)}"
    for lost in left_out(model, command.usd_joints):
        say(f"          not in the take, for want of a word in USD: {lost}")
    say(f"take      {command.out} ({len(take.body_q)} frames at {take.fps:g} fps, {state})")
    say(f"pictures  {picture}, {plots.name}")
    if command.html:
        say(f"replay    {replay} (open it in a browser)")
    if command.film is not None:
        with bar("drawing", frame_count(take)) as progress:
            write_film(command.film, take, skin=skin, device=command.device, progress=progress)
        say(f"film      {command.film} ({command.film.stat().st_size / 1e6:.1f} MB)")


def say_trajectory(model: Model, seen: Trajectory, root: str, cycles: float | None) -> Tracking:
    """Say how it went, and measure it."""
    import numpy as np

    from ..learning.evaluate.tracking import track

    found = track(model, seen)
    fell = f", first at {found.fallen.argmax() * seen.timestep:.2f} s" if found.falls else ""
    say(f"simulated {seen.duration:.2f} s with root {root}, {seen.real_time_factor:.1f} x real time")
    say(
        f"tracking  joints {np.degrees(found.angle_error.mean()):.1f} degrees, "
        f"bodies {100.0 * found.position_error.mean():.1f} cm off (means, fingers left out)"
    )
    if root == "free":
        place = np.linalg.norm(found.drift[:, :2], axis=1)
        turn = np.degrees(np.abs(found.drift[:, 2]))
        say(
            f"drift     {place[-1]:.2f} m and {turn[-1]:.0f} degrees from the reference at the end, "
            f"{place.max():.2f} m and {turn.max():.0f} degrees at most"
        )
    if root == "tracked":
        limb, slides = found.limbs[0], np.nanmax([0.0, *(limb.sliding for limb in found.limbs)])
        say(
            f"          worst limb {limb.name}, {100.0 * limb.worst:.1f} cm off in frame {limb.frame}, "
            f"{100.0 * limb.far:.1f} cm in 95 % of the time"
        )
        say(f"          standing feet slide at {100.0 * slides:.0f} cm/s or less in 95 % of the time")
    say(f"falls     {found.falls}{fell}")
    if "ball on ground" in found.contacts:
        ground = found.contacts["ball on ground"]
        bounces = int(np.sum(ground[1:] & ~ground[:-1]))
        how = "put in play, nobody controls it"
        if cycles is not None:
            lost = "never lost" if np.isnan(seen.lost) else f"lost after {seen.lost:.2f} s"
            how = f"{cycles:.1f} cycles, {lost}"
        say(f"ball      {bounces} bounces ({how})")
    return found
