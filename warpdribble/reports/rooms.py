"""The import graph of the rooms as a picture in which every arrow points downward.

    python -m warpdribble.reports.rooms [docs/pictures/rooms.png]

reads the checkout that this file stands in. An arrow is left out where a longer way says the same. Where
rooms stand in a circle, the arrows that would have to go up are drawn in red.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch
from matplotlib.path import Path as Line
from PIL import Image
from scipy.interpolate import PchipInterpolator

from . import layout
from .imports import TOP, Imports, between, circles, read_tree, rooms
from .layout import Bend, Edge, Node, Way

ROOT = Path(__file__).resolve().parents[2]
GROUND = (f"{TOP}.kernels", f"{TOP}.assets")
"""Rooms that are drawn at the bottom whoever needs them."""
COLOURS = {
    "kernels": "#f3d6c9",
    "assets": "#e6e2d3",
    "benchmarks": "#e6e2d3",
    "sims": "#cfe3ee",
    "learning": "#d8e8cf",
}
"""Of the folders at the top; the rest is warpdribble's own."""
OWN, INK, PALE, WRONG = "#fbe7b2", "#30363d", "#7d8792", "#c0392b"
FLOOR, HEIGHT, GAP = 0.84, 0.44, 0.24
"""[in] from floor to floor, of a room, between two rooms."""
BEND, LEAN = 0.34, 0.12
"""[in] that an arrow has for its way past a floor's rooms, and that it may lean there."""
LETTER, LEAST = 0.075, 0.8
"""[in] of a letter's width, of a room's."""
APART = 0.22
"""[in] between the ends of two arrows at a room."""
DPI = 120


def draw(out: Path, sizes: dict[str, int], edges: set[Edge], wrong: frozenset[Edge] = frozenset()) -> None:
    """Write the picture. sizes: room -> number of modules. edges: no circle. wrong: those that go up."""
    shown = layout.direct(edges)
    floor = layout.lifted(layout.floors(edges, sizes), shown, GROUND)
    lines = layout.ways(floor, shown)
    layers = layout.order(floor, lines)
    width = {node: _width(node) for layer in layers for node in layer}
    x = layout.places(layers, lines, width, GAP)
    left = min(x[node] - width[node] / 2 for node in x) - 0.15
    right = max(x[node] + width[node] / 2 for node in x) + 0.15
    figure = Figure(figsize=(right - left, len(layers) * FLOOR), dpi=DPI)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_xlim(left, right)
    axes.set_ylim(-FLOOR / 2, (len(layers) - 0.5) * FLOOR)
    axes.axis("off")
    ends = _ends(lines, x, width)
    for line in lines:
        axes.add_patch(_arrow(_course(line, floor, x, ends), PALE, 1))
    for by, of in sorted(wrong):
        axes.add_patch(
            _arrow([(x[by], floor[by] * FLOOR), (x[of], floor[of] * FLOOR - HEIGHT / 2)], WRONG, 4)
        )
    for room, size in sizes.items():
        _box(axes, room, size, x[room], floor[room] * FLOOR, width[room])
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    out.parent.mkdir(parents=True, exist_ok=True)
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
    image.quantize(256, Image.Quantize.FASTOCTREE).save(out, optimize=True)


def label(room: str) -> str:
    """A room's name on the page; loose modules that share a room are named one by one."""
    names = [name.removeprefix(f"{TOP}.") for name in room.split("+")]
    hall = names[0].rpartition(".")[0]
    if len(names) == 1 or not hall:
        return ", ".join(name for name in names if name != "__main__")
    return f"{hall}: {', '.join(name.rpartition('.')[2] for name in names)}"


def without_circles(edges: Imports) -> tuple[set[Edge], frozenset[Edge]]:
    """Edges that close no circle, and the others: of every circle the one with the fewest imports."""
    kept = dict(edges)
    while found := circles(kept):
        inside = [edge for edge in kept if edge[0] in found[0] and edge[1] in found[0]]
        del kept[min(inside, key=lambda edge: (len(kept[edge]), edge))]
    return set(kept), frozenset(edges.keys() - kept.keys())


def _ends(lines: list[Way], x: dict[Node, float], width: dict[Node, float]) -> dict[tuple[Edge, int], float]:
    """(edge, 0 for its beginning or 1 for its end) -> x [in]: the arrows of a room do not share a point."""
    found = {}
    for end, room in {(end, line.edge[end]) for line in lines for end in (0, 1)}:
        mine = [line for line in lines if line.edge[end] == room]
        mine.sort(key=lambda line: x[line.nodes[-2 if end else 1]])
        half = min(0.42 * width[room], APART * (len(mine) - 1) / 2)
        for line, at in zip(mine, np.linspace(-half, half, len(mine)) if len(mine) > 1 else [0.0]):
            found[line.edge, end] = x[room] + at
    return found


def _course(
    line: Way, floor: dict[str, int], x: dict[Node, float], ends: dict[tuple[Edge, int], float]
) -> list[tuple[float, float]]:
    """Points of an arrow, smooth and x over y, so that it can only go down; steep where it passes a floor."""
    by, of = line.edge
    at = [ends[line.edge, 0], *(x[bend] for bend in line.bends), ends[line.edge, 1]]
    points = [(at[0], floor[by] * FLOOR - HEIGHT / 2)]
    for bend, above, here, below in zip(line.bends, at, at[1:], at[2:]):
        for end, side in ((above, 1), (below, -1)):
            lean = min(max(0.2 * (end - here), -LEAN), LEAN)
            points.append((here + lean, bend.floor * FLOOR + side * HEIGHT / 2))
    points.append((at[-1], floor[of] * FLOOR + HEIGHT / 2))
    across, y = np.array(points[::-1]).T
    fine = np.linspace(y[-1], y[0], 12 * len(points))
    return list(zip(PchipInterpolator(y, across)(fine), fine))


def _arrow(points: list[tuple[float, float]], colour: str, zorder: int) -> FancyArrowPatch:
    style = "-|>,head_length=4.5,head_width=2.2"
    return FancyArrowPatch(path=Line(points), arrowstyle=style, color=colour, linewidth=0.9, zorder=zorder)


def _box(axes: Axes, room: str, size: int, x: float, y: float, width: float) -> None:
    face = COLOURS.get(room.split(".")[1], OWN)
    corner, style = (x - width / 2, y - HEIGHT / 2), "round,pad=0,rounding_size=0.08"
    axes.add_patch(
        FancyBboxPatch(corner, width, HEIGHT, boxstyle=style, fc=face, ec=INK, linewidth=0.8, zorder=2)
    )
    axes.text(x, y + 0.07, label(room), ha="center", va="center", fontsize=9.5, color=INK, zorder=3)
    said = f"{size} module{'s' if size > 1 else ''}"
    axes.text(x, y - 0.12, said, ha="center", va="center", fontsize=6.5, color=PALE, zorder=3)


def _width(node: Node) -> float:
    return BEND if isinstance(node, Bend) else max(LEAST, LETTER * len(label(node)) + 0.22)


def main(out: Path, root: Path = ROOT) -> None:
    """Draw the rooms of a checkout."""
    tree = read_tree(root)
    edges = tree.ours()
    room = rooms(tree, edges)
    named = [name for name, path in tree.modules.items() if name in room and path.name != "__init__.py"]
    sizes = dict.fromkeys(sorted(set(room.values())), 1) | Counter(room[name] for name in named)
    down, up = without_circles(between(edges, room))
    draw(out, sizes, down, up)
    said = (
        f"; {len(up)} upward: {', '.join(f'{label(by)} -> {label(of)}' for by, of in sorted(up))}"
        if up
        else ""
    )
    print(f"{out}: {len(sizes)} rooms, {len(named)} modules, {len(down)} arrows{said}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/pictures/rooms.png"))
