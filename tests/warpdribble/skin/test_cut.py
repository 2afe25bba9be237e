"""Meshes that are made finer and cut, on a sphere, where areas are known."""

import numpy as np
import pytest
import trimesh

from warpdribble.skin.cut import Net, cut, onto, refine

R = 0.1
"""[m]"""


class Ball:
    """The sphere as a surface to cut on."""

    def slope(self, points):
        size = np.linalg.norm(points, axis=1)
        return size - R, points / size[:, None]


@pytest.fixture(scope="module")
def ball():
    sphere = trimesh.creation.icosphere(subdivisions=4)
    points = np.asarray(sphere.vertices)
    share = np.stack([0.5 + 0.5 * points[:, 0], 0.5 - 0.5 * points[:, 0]], axis=1)
    return Net.of(R * points, np.asarray(sphere.faces), share)


def solid(net):
    return trimesh.Trimesh(net.points, net.faces, process=False)


def between(net, a, b):
    return np.intersect1d(*(np.unique(net.faces[net.region == r]) for r in (a, b)))


@pytest.mark.parametrize("height", [-0.07, 0.0, 0.031])
def test_a_cap_has_its_area_and_a_level_border(ball, height):
    found = cut(ball, Ball(), lambda p: height - p[:, 2], 1)
    whole = solid(found)
    assert whole.is_watertight and whole.is_winding_consistent
    assert whole.area_faces[found.region == 1].sum() == pytest.approx(
        2.0 * np.pi * R * (R - height), rel=0.01
    )
    rim = found.points[between(found, 0, 1)]
    assert np.abs(rim[:, 2] - height).max() < 1e-9
    assert np.abs(np.linalg.norm(found.points, axis=1) - R).max() < 1e-6
    assert np.allclose(found.values.sum(axis=1), 1.0)


def test_a_second_cut_leaves_the_first_border_where_it_is(ball):
    centre = np.array([0.1, 0.0, 0.03])
    once = cut(ball, Ball(), lambda p: 0.03 - p[:, 2], 1)
    twice = cut(once, Ball(), lambda p: np.linalg.norm(p - centre, axis=1) - 0.05, 2)
    assert solid(twice).is_watertight and solid(twice).is_winding_consistent
    assert np.abs(twice.points[between(twice, 0, 1), 2] - 0.03).max() < 1e-9
    for region in (0, 1):
        rim = twice.points[between(twice, region, 2)]
        free = np.abs(rim[:, 2] - 0.03) > 1e-7
        assert np.abs(np.linalg.norm(rim[free] - centre, axis=1) - 0.05).max() < 1e-7
        assert np.abs(np.linalg.norm(rim - centre, axis=1) - 0.05).max() < 2e-4


def test_a_field_that_is_nowhere_zero_cuts_nothing(ball):
    for value, region in ((1.0, 0), (-1.0, 1)):
        found = cut(ball, Ball(), lambda p, v=value: np.full(len(p), v), 1)
        assert np.array_equal(found.faces, ball.faces) and set(found.region) == {region}


def test_edges_become_as_short_as_is_wanted_and_no_gap_opens(ball):
    def wanted(net, pairs):
        a, b = net.points[pairs[:, 0]], net.points[pairs[:, 1]]
        return (np.linalg.norm(a - b, axis=1) > 0.003) & (np.abs(0.5 * (a + b)[:, 2]) < 0.01)

    fine = refine(ball, Ball(), wanted, 12)
    whole = solid(fine)
    assert whole.is_watertight and whole.is_winding_consistent
    assert not wanted(fine, whole.edges_unique).any()
    assert np.degrees(whole.face_angles.min()) > 12.0
    assert np.abs(np.linalg.norm(fine.points, axis=1) - R).max() < 1e-7
    assert len(fine.faces) < 6 * len(ball.faces)


def test_points_come_onto_the_surface_the_shortest_way():
    away = np.random.default_rng(1).normal(size=(50, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    assert np.allclose(onto(Ball(), None, 1.04 * R * away), R * away, atol=1e-7)
