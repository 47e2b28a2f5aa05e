"""Grains that rest on beds in space: heights from elementary geometry, nothing in the bed."""

import functools

import numpy as np
import pytest
from every_shape import SOLIDS, TERRAINS, vectors
from hypothesis import given, settings
from hypothesis import strategies as st

from incipient.geometry import (
    Box,
    Ellipsoid,
    Placement,
    Plane,
    Sphere,
    SphereBed,
    clearance,
    lifted,
    rest,
)
from incipient.geometry.placement import rotation_by


@functools.cache
def surface_points(name):
    """Points (n, 3) of a grain's surface, without those of its parts that lie inside it."""
    points = SOLIDS[name].surface(SOLIDS[name].size / 60.0).points
    return points[np.abs(SOLIDS[name].level(points)) < 1e-12]


class TestRestInSpace:
    """Heights at rest from elementary geometry, stated case by case."""

    def height(self, grain, bed, x, quaternion=0.0):
        return rest(grain, bed, x, quaternion).centre[2]

    def test_sphere_on_a_slope(self):
        # The contact is R along the normal: z = slope.x + R sqrt(1 + |slope|^2).
        expected = 0.1 + 0.3 * 2.0 - 0.2 * 1.0 + 0.5 * np.sqrt(1.0 + 0.09 + 0.04)
        assert self.height(Sphere(1.0), Plane((0.3, -0.2), 0.1), (2.0, 1.0)) == pytest.approx(
            expected, abs=1e-13
        )

    def test_sphere_on_a_ball_beside_its_top(self):
        # Distance of the centres R + r: z^2 = (R + r)^2 - |x|^2.
        expected = np.sqrt(0.9**2 - 0.2**2 - 0.1**2)
        assert self.height(Sphere(1.0), SphereBed.array(0.4, 3.0), (0.2, 0.1)) == pytest.approx(
            expected, abs=1e-12
        )

    @settings(max_examples=40, deadline=None)
    @given(vectors)
    def test_ellipsoid_on_a_plane_by_its_support_function(self, turn):
        # Downwards it reaches |diag(a, b, c) R^T e_z|.
        placement = Placement((0, 0, 0)).moved((0, 0, 0), turn)
        expected = np.linalg.norm(np.array([0.7, 0.5, 0.3]) * placement.rotation[2])
        height = self.height(Ellipsoid((0.7, 0.5, 0.3)), Plane(), (0.0, 0.0), placement.quaternion)
        assert height == pytest.approx(expected, abs=1e-12)

    @settings(max_examples=40, deadline=None)
    @given(vectors)
    def test_rounded_box_on_a_plane_by_its_support_function(self, turn):
        # The core reaches sum of half sides times |R_zi| down, the ball r more.
        placement = Placement((0, 0, 0)).moved((0, 0, 0), turn)
        expected = np.array([0.4, 0.2, 0.1]) @ np.abs(placement.rotation[2]) + 0.1
        height = self.height(Box((1.0, 0.6, 0.4), 0.1), Plane(), (0.0, 0.0), placement.quaternion)
        assert height == pytest.approx(expected, abs=1e-13)

    @pytest.mark.slow
    @settings(max_examples=40, deadline=None)
    @given(
        name=st.sampled_from(list(SOLIDS)),
        bed=st.sampled_from(list(TERRAINS.values())),
        turn=vectors,
        x=st.tuples(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7)),
    )
    def test_resting_touches_and_enters_nowhere(self, name, bed, turn, x):
        solid = SOLIDS[name]
        placement = rest(solid, bed, x, rotation_by(turn))
        assert placement.centre[:2] == x
        distance, on_grain, on_bed = clearance(solid, placement, bed)
        assert distance == pytest.approx(0.0, abs=1e-12 * solid.size)
        assert solid.level(placement.to_body([on_grain])) == pytest.approx(0.0, abs=1e-9)
        assert bed.height(on_bed[None, :2]) == pytest.approx(on_bed[2], abs=1e-9)
        points = placement.to_scene(surface_points(name))
        assert (points[:, 2] - bed.height(points[:, :2])).min() >= -1e-12

    @pytest.mark.parametrize("gap", [0.003, 0.05])
    def test_lifted_out_of_a_pocket(self, gap):
        # The triangle of centres with sides R + r + gap.
        bed = SphereBed.array(0.5, 1.0, "triangular")
        x = (0.5, np.sqrt(1.0 / 12.0))
        raised = lifted(Sphere(1.0), rest(Sphere(1.0), bed, x), bed, gap)
        assert raised.centre[2] == pytest.approx(np.sqrt((1.0 + gap) ** 2 - 1.0 / 3.0), abs=1e-10)
        assert clearance(Sphere(1.0), raised, bed)[0] == pytest.approx(gap, abs=1e-10)

    def test_overlap_is_negative(self):
        assert clearance(Sphere(1.0), Placement((0.0, 0.0, 0.3)), Plane())[0] == pytest.approx(-0.2)
