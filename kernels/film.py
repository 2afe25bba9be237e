"""A picture of triangles over a floor: one ray and its shadows for each sample of each pixel.

Light comes from a sun, whose disc makes soft shadows, and from the sky as far as nothing near is in the way.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

FAR = wp.constant(60.0)
"""[m]"""
NEAR = wp.constant(0.6)
"""[m] within which things keep the sky's light from each other."""
LIFT = wp.constant(1.0e-3)
"""[m] off a surface, where its shadow rays begin."""


@wp.struct
class Look:
    """What the light and the floor are like, and where the camera is."""

    eye: wp.vec3
    """[m]"""
    right: wp.vec3
    up: wp.vec3
    ahead: wp.vec3
    """axes of the picture; the first two as long as half of it is wide and high, 1 m ahead"""
    sun: wp.vec3
    """unit vector towards it"""
    disc: float
    """[rad] its radius"""
    sunlight: wp.vec3
    sky: wp.vec3
    bounce: wp.vec3
    """light, linear RGB: from the sun, from above, from below"""
    floor: wp.vec3
    lines: wp.vec3
    beyond: wp.vec3
    """colours, linear RGB"""
    fog: float
    """[m] after which the floor is as what is beyond it"""


@wp.func
def on_sphere(u: float, v: float) -> wp.vec3:
    """A point of the unit sphere, evenly for u and v from 0 to 1."""
    z = 1.0 - 2.0 * u
    r = wp.sqrt(wp.max(0.0, 1.0 - z * z))
    return wp.vec3(r * wp.cos(2.0 * wp.pi * v), r * wp.sin(2.0 * wp.pi * v), z)


@wp.func
def lit(
    mesh: wp.uint64, look: Look, at: wp.vec3, normal: wp.vec3, colour: wp.vec3, u: float, v: float
) -> wp.vec3:
    """Colour of a surface, from one ray towards the sun's disc and one into the sky, where u and v say."""
    start = at + LIFT * normal
    spot = on_sphere(u, v)
    sun = wp.normalize(look.sun + look.disc * spot)
    facing = wp.max(0.0, wp.dot(normal, sun))
    direct = wp.vec3(0.0)
    if facing > 0.0:
        if not wp.mesh_query_ray_anyhit(mesh, start, sun, FAR):
            direct = facing * look.sunlight
    away = wp.normalize(normal + 0.999 * spot)
    open = 1.0
    if away[2] > 0.0:
        if wp.mesh_query_ray_anyhit(mesh, start, away, NEAR):
            open = 0.25
    share = 0.5 + 0.5 * away[2]
    around = open * (share * look.sky + (1.0 - share) * look.bounce)
    return wp.cw_mul(colour, direct + around)


@wp.func
def ground(look: Look, at: wp.vec3, wide: float) -> wp.vec3:
    """The floor's colour, lines a metre apart. wide: [m] of a pixel there."""
    dx = wp.abs(at[0] - wp.round(at[0]))
    dy = wp.abs(at[1] - wp.round(at[1]))
    line = 1.0 - wp.smoothstep(0.008, 0.012 + wide, wp.min(dx, dy))
    line = line * 0.024 / (0.024 + wide)
    return look.floor * (1.0 - line) + look.lines * line


@wp.kernel
def photograph(
    mesh: wp.uint64,
    normals: wp.array(dtype=wp.vec3),
    colours: wp.array(dtype=wp.vec3),
    look: Look,
    samples: int,
    out: wp.array2d(dtype=wp.vec3),
):
    """out (height, width): linear RGB. normals: of points; colours: of faces. samples: squared, per pixel."""
    row, column = wp.tid()
    height, width = out.shape[0], out.shape[1]
    state = wp.rand_init(1, row * width + column)
    turn_u, turn_v = wp.randf(state), wp.randf(state)
    total = wp.vec3(0.0)
    step = 1.0 / float(samples)
    for i in range(samples):
        for j in range(samples):
            x = (float(column) + (float(i) + wp.randf(state)) * step) / float(width) * 2.0 - 1.0
            y = 1.0 - (float(row) + (float(j) + wp.randf(state)) * step) / float(height) * 2.0
            along = wp.normalize(look.ahead + x * look.right + y * look.up)
            hit = wp.mesh_query_ray(mesh, look.eye, along, FAR)
            down = FAR
            if along[2] < -1.0e-4:
                down = -look.eye[2] / along[2]
            n = float(i * samples + j)  # spots spread evenly (Roberts 2018), turned in each pixel
            u = wp.frac(turn_u + 0.7548777 * n)
            v = wp.frac(turn_v + 0.5698403 * n)
            if hit.result and hit.t < down:
                a = wp.mesh_get_index(mesh, 3 * hit.face)
                b = wp.mesh_get_index(mesh, 3 * hit.face + 1)
                c = wp.mesh_get_index(mesh, 3 * hit.face + 2)
                across = 1.0 - hit.u - hit.v
                normal = wp.normalize(hit.u * normals[a] + hit.v * normals[b] + across * normals[c])
                total += lit(mesh, look, look.eye + hit.t * along, normal, colours[hit.face], u, v)
            elif down < FAR:
                at = look.eye + down * along
                wide = down * wp.length(look.up) * 2.0 / float(height) / wp.max(0.1, -along[2])
                seen = lit(mesh, look, at, wp.vec3(0.0, 0.0, 1.0), ground(look, at, wide), u, v)
                near = wp.exp(-(down / look.fog) * (down / look.fog))
                total += near * seen + (1.0 - near) * look.beyond
            else:
                total += look.beyond
    out[row, column] = total * (step * step)
