"""Operations on arrays that only speed or a starting value would show to be wrong."""

import numpy as np
import pytest

from incipient.arrays import extrapolated, unit

ROWS = np.random.default_rng(3).normal(size=(5, 3))


def test_unit_vectors_keep_their_direction_and_nothing_stays_nothing():
    a = np.vstack([ROWS, np.zeros(3)])
    assert np.linalg.norm(unit(a), axis=1) == pytest.approx([1, 1, 1, 1, 1, 0])
    assert np.abs(np.cross(a, unit(a))).max() < 1e-15
    assert unit(a[0]) == pytest.approx(a[0] / np.linalg.norm(a[0]))


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_polynomials_of_the_degree_are_extrapolated_exactly(degree):
    def polynomial(t):
        return np.array([1.0 + 2.0 * t**degree, -(t**degree)])

    times = [0.7, 0.4, -0.1][: degree + 1]
    assert extrapolated(times, [polynomial(t) for t in times], 1.1) == pytest.approx(
        polynomial(1.1), rel=1e-13
    )
