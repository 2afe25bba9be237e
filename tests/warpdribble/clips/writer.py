"""A BVH file as any writer may have it, and where its joints are: by matrices, without our code."""

import numpy as np

PERSON = {
    "Hips": ("", (0, 0, 0)),
    "Spine": ("Hips", (0, 10, -1)),
    "Chest": ("Spine", (0, 38, 0)),
    "Head": ("Chest", (0, 25, 2)),
    **{
        f"{side}{part}": (
            f"{side}{above}" if above != "Chest" and above != "Hips" else above,
            (sign * x, y, z),
        )
        for side, sign in (("Left", 1), ("Right", -1))
        for part, above, (x, y, z) in (
            ("Arm", "Chest", (17, 11, 0)),
            ("ForeArm", "Arm", (28, 0, 0)),
            ("Hand", "ForeArm", (26, 0, 0)),
            ("UpLeg", "Hips", (9, -5, 0)),
            ("Leg", "UpLeg", (0, -42, 0)),
            ("Foot", "Leg", (0, -42, -1)),
            ("ToeBase", "Foot", (0, -7, 13)),
        )
    },
}
"""Joint -> (parent, offset [cm]), Y up, facing Z, the left side to X."""
SIX = "Xposition Yposition Zposition Zrotation Xrotation Yrotation"
TURNS = "Zrotation Xrotation Yrotation"


class Clip:
    """Numbers for every channel of every joint, drawn at random; the hips go forward."""

    def __init__(self, bones=PERSON, channels=None, frames=5, seed=0):
        rng = np.random.default_rng(seed)
        self.bones, self.frames = bones, frames
        root = next(iter(bones))
        self.channels = {n: (SIX if n == root else TURNS).split() for n in bones}
        self.channels |= {n: words.split() for n, words in (channels or {}).items()}
        self.values = {}
        for name, words in self.channels.items():
            angles = {w: rng.uniform(-20, 20, frames).round(4) for w in words if w.endswith("rotation")}
            moved = {f"{a}position": np.full(frames, float(o)) for a, o in zip("XYZ", bones[name][1])}
            self.values[name] = angles | {w: moved[w] for w in words if w in moved}
        if "Zposition" in self.values[root]:
            self.values[root] |= {"Yposition": np.full(frames, 96.0), "Zposition": 2.0 * np.arange(frames)}

    def text(self, frame_time="0.0166667", frames=None):
        lines, order = [], []

        def write(name, depth):
            order.append(name)
            pad, (_, offset), words = "\t" * depth, self.bones[name], self.channels[name]
            lines.append(f"{pad}{'JOINT' if depth else 'ROOT'} {name}")
            lines.append(f"{pad}{{")
            lines.append(f"{pad}\tOFFSET {' '.join(f'{v:.4f}' for v in offset)}")
            lines.append(f"{pad}\tCHANNELS {len(words)} {' '.join(words)}")
            children = [n for n, (parent, _) in self.bones.items() if parent == name]
            for child in children:
                write(child, depth + 1)
            if not children:
                lines.extend([f"{pad}\tEnd Site", f"{pad}\t{{", f"{pad}\t\tOFFSET 0.0 5.0 5.0", f"{pad}\t}}"])
            lines.append(f"{pad}}}")

        write(next(iter(self.bones)), 0)
        columns = [self.values[name][word] for name in order for word in self.channels[name]]
        rows = [" ".join(f"{column[f]:.6f}" for column in columns) for f in range(self.frames)]
        header = ["MOTION", f"Frames: {self.frames if frames is None else frames}"]
        return "\n".join(["HIERARCHY", *lines, *header, f"Frame Time: {frame_time}", *rows]) + "\n"

    def places(self, positions=True):
        """Joint -> (frames, 3) [m], Z up, X forward."""
        found, frames = {}, {}
        for name, (parent, offset) in self.bones.items():
            above = frames[parent] if parent else np.tile(np.eye(4), (self.frames, 1, 1))
            own, values = np.tile(np.eye(4), (self.frames, 1, 1)), self.values[name]
            for axis, letter in enumerate("XYZ"):
                used = positions or not parent
                own[:, axis, 3] = values.get(f"{letter}position", offset[axis]) if used else offset[axis]
            for word in self.channels[name]:
                if word.endswith("rotation"):
                    own = own @ turned("XYZ".index(word[0]), np.radians(values[word]))
            frames[name] = above @ own
            found[name] = 0.01 * frames[name][:, [2, 0, 1], 3]
        return found


def turned(axis, angles):
    """(frames, 4, 4) about an axis."""
    turn, (a, b) = np.tile(np.eye(4), (len(angles), 1, 1)), ((axis + 1) % 3, (axis + 2) % 3)
    turn[:, a, a] = turn[:, b, b] = np.cos(angles)
    turn[:, b, a], turn[:, a, b] = np.sin(angles), -np.sin(angles)
    return turn
