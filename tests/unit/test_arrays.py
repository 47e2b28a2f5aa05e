"""The operations on arrays of vectors, against numpy's or by hand."""

import numpy as np
import pytest

from incipient.arrays import cross, extrapolated, planar_cross, quarter_turned, rows, spatial, unit

PAIRS = np.random.default_rng(3).normal(size=(2, 5, 3))


def test_products_agree_with_the_vector_product_of_numpy():
    a, b = PAIRS
    assert cross(a, b) == pytest.approx(np.cross(a, b), abs=1e-15)
    flat = spatial(a[:, :2]), spatial(b[:, :2])
    assert planar_cross(a[:, :2], b[:, :2]) == pytest.approx(np.cross(*flat)[:, 2], abs=1e-15)
    assert planar_cross(a[:, :2], quarter_turned(a[:, :2])) == pytest.approx(
        (a[:, :2] ** 2).sum(axis=1)
    )


def test_unit_vectors_keep_their_direction_and_nothing_stays_nothing():
    a = np.vstack([PAIRS[0], np.zeros(3)])
    assert np.linalg.norm(unit(a), axis=1) == pytest.approx([1, 1, 1, 1, 1, 0])
    assert np.abs(np.cross(a, unit(a))).max() < 1e-15
    assert unit(a[0]) == pytest.approx(a[0] / np.linalg.norm(a[0]))


def test_one_point_is_a_row_and_plane_vectors_get_a_third_component():
    assert rows([1, 2]).tolist() == [[1.0, 2.0]]
    assert spatial([1, 2]).tolist() == [1.0, 2.0, 0.0]
    assert spatial(PAIRS) == pytest.approx(PAIRS)


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_polynomials_of_the_degree_are_extrapolated_exactly(degree):
    def polynomial(t):
        return np.array([1.0 + 2.0 * t**degree, -(t**degree)])

    times = [0.7, 0.4, -0.1][: degree + 1]
    assert extrapolated(times, [polynomial(t) for t in times], 1.1) == pytest.approx(
        polynomial(1.1), rel=1e-13
    )
