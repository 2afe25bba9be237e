"""Random MJCF trees for property tests."""

import numpy as np
from hypothesis import strategies as st

# steps of 1/64: MuJoCo takes a rotation by 1e-8 for none, which a comparison to 1e-10 would notice
number = st.integers(-64, 64).map(lambda k: k / 64)
share = st.integers(0, 64).map(lambda k: k / 64)


def text(values):
    return " ".join(f"{x:.6g}" for x in np.atleast_1d(values))


def unit_vector(draw, n):
    """Any direction."""
    v = np.array([draw(number) for _ in range(n)])
    return v / np.linalg.norm(v) if np.linalg.norm(v) > 0.1 else np.eye(n)[0]


def between(draw, low, high):
    return low + (high - low) * draw(share)


def inertial(draw):
    """Off the body's origin, with turned principal axes that satisfy the triangle inequality."""
    pos = [0.2 * draw(number) for _ in range(3)]
    a, b, c = (between(draw, 0.002, 0.05) for _ in range(3))
    return (
        f'<inertial pos="{text(pos)}" quat="{text(unit_vector(draw, 4))}"'
        f' mass="{text(between(draw, 0.3, 3.0))}" diaginertia="{text([a + b, b + c, a + c])}"/>'
    )


@st.composite
def trees(draw, driven=True):
    """An MJCF tree of free, ball, hinge and welded bodies: several hinges on a body, anchors off its
    origin, refs, off-centre inertias; with `driven`, position servos with effort limits, damping,
    stiffness and armature."""
    actuators, count = [], [0]

    def joint(kind):
        name = f"j{count[0]}"
        count[0] += 1
        pos = [0.2 * draw(number) for _ in range(3)]
        out = f'<joint name="{name}" type="{kind}" pos="{text(pos)}"'
        out += f' armature="{text(between(draw, 0.01, 0.1))}"'
        if draw(st.booleans()):
            out += f' damping="{text(between(draw, 0.01, 2.0))}"'
        if draw(st.booleans()):
            out += f' stiffness="{text(between(draw, 1.0, 50.0))}"'
        if kind == "hinge":
            out += f' axis="{text(unit_vector(draw, 3))}" ref="{text(draw(number))}"'
            out += f' springref="{text(draw(number))}"'
        if driven and draw(st.booleans()):
            kp, kv = between(draw, 5.0, 300.0), between(draw, 0.0, 20.0)
            # about every other limit is met: errors are of the order of 1 rad
            limit = kp * between(draw, 0.3, 3.0)
            for gear in ("1 0 0", "0 1 0", "0 0 1")[: 3 if kind == "ball" else 1]:
                actuators.append(
                    f'<position joint="{name}" gear="{gear}" kp="{text(kp)}" kv="{text(kv)}"'
                    f' forcerange="{text([-limit, limit])}"/>'
                )
        return out + "/>"

    def body(depth, root):
        kinds = ["ball", "hinge", "hinges", "mixed", "weld"] + ["free"] * 3 * root
        kind = draw(st.sampled_from(kinds))
        pos = [0.4 * draw(number) for _ in range(3)]
        out = f'<body pos="{text(pos)}" quat="{text(unit_vector(draw, 4))}">' + inertial(draw)
        if kind == "free":
            out += f'<joint name="j{count[0]}" type="free" armature="{text(between(draw, 0, 0.1))}"/>'
            count[0] += 1
        elif kind == "hinges":
            out += "".join(joint("hinge") for _ in range(draw(st.integers(2, 3))))
        elif kind == "mixed":
            out += "".join(joint(k) for k in ("hinge", "ball"))
        elif kind != "weld":
            out += joint(kind)
        for _ in range(draw(st.integers(0, 2 if depth < 2 else 1)) if depth < 4 else 0):
            out += body(depth + 1, False)
        return out + "</body>"

    roots = "".join(body(0, True) for _ in range(draw(st.integers(1, 2))))
    if not count[0]:  # all welded
        roots += f'<body name="last">{inertial(draw)}{joint("ball")}</body>'
    gravity = text([0, 0, -9.81] if draw(st.booleans()) else 5 * np.array([draw(number) for _ in range(3)]))
    return (
        '<mujoco><compiler angle="radian"/>'
        f'<option timestep="{draw(st.sampled_from([0.002, 0.01]))}" gravity="{gravity}"/>'
        f"<worldbody>{roots}</worldbody><actuator>{''.join(actuators)}</actuator></mujoco>"
    )
