"""Gusts that last long enough to move a grain out of its pocket, in series that are made, and by stored curves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from incipient.errors import SceneError
from incipient.threshold.lasting import Series, WeakestGusts, rate_of_lasting, series_of
from incipient.threshold.laws import Gaussian


class TestLasting:
    WEAKEST = WeakestGusts(np.array([0.5, 2.0]), np.array([4.0, 2.0]), np.zeros(2), static=1.5)

    def test_gusts_are_counted_that_last_as_long_as_the_weakest(self) -> None:
        step = 0.01
        factors = np.ones(10_000)
        for start, duration, strength in (
            (10.0, 0.6, 4.1),
            (20.0, 0.4, 4.1),
            (30.0, 2.2, 2.1),
            (40.0, 1.0, 2.1),
        ):
            factors[round(start / step) : round((start + duration) / step)] = strength
        found = rate_of_lasting(Series(factors, step), self.WEAKEST, 1.0)
        assert found.rate * 10_000 * step == pytest.approx(2.0, rel=1e-3)
        assert found.low < found.rate < found.high

    def test_between_durations_the_logarithms_are_straight(self) -> None:
        levels, durations = self.WEAKEST.needed()
        assert np.interp(math.sqrt(8.0), levels, durations) == pytest.approx(1.0, rel=2e-3)

    def test_made_series_has_the_correlation_that_is_stated(self) -> None:
        microscale, integral = 0.5, 2.0
        course = series_of(Gaussian(0.3, False, microscale), integral)
        values = (course.factors - 1.0) / 0.3
        root = math.sqrt(integral**2 - 2.0 * microscale**2)
        first, second = 0.5 * (integral + root), 0.5 * (integral - root)
        for steps in (16, 64, 128):
            time = steps * course.step
            expected = (first * math.exp(-time / first) - second * math.exp(-time / second)) / (
                first - second
            )
            assert np.mean(values[steps:] * values[:-steps]) == pytest.approx(expected, abs=0.02)

    def test_times_that_are_missing_are_named(self) -> None:
        with pytest.raises(SceneError, match=r"gusts\.integral_time: is missing"):
            series_of(Gaussian(0.3, True, 0.5), None)

    def test_times_that_no_correlation_has_are_refused(self) -> None:
        """T1 + T2 is at least the root of 4 T1 T2, the microscale times the root of two."""
        with pytest.raises(
            SceneError, match=r"gusts\.integral_time: is 0\.7, less than the microscale 0\.5"
        ):
            series_of(Gaussian(0.3, True, 0.5), 0.7)

    def test_gusts_of_another_flow_are_refused(self) -> None:
        self.WEAKEST.require_of(1.6)
        with pytest.raises(
            SceneError, match=r"gusts\.json: there a steady flow .* from 1\.5 on, here from 2\.3"
        ):
            self.WEAKEST.require_of(2.3)

    def test_errors_that_are_not_known_are_not_taken_as_known(self) -> None:
        points = [
            {"duration": one, "strength": 3.0, "error": error}
            for one, error in ((1.0, 0.1), (2.0, None))
        ]
        found = WeakestGusts.of({"static": 1.5, "points": points})
        assert not found.known and found.errors.tolist() == [0.1, 0.0]
        assert WeakestGusts.of({"static": 1.5, "points": [points[0], points[0]]}).known

    @pytest.mark.parametrize(
        ("static", "points", "said"),
        [
            (1.5, [{"duration": 1.0, "error": 0.1}] * 2, "holds no gusts"),
            (None, [{"duration": 1.0, "strength": 3.0, "error": 0.1}] * 2, "holds no gusts"),
            (1.5, {"a": 1}, "holds no gusts"),
            (1.5, [{"duration": 1.0, "strength": 3.0, "error": 4.0}] * 2, "within its error"),
        ],
    )
    def test_files_that_are_damaged_are_refused(self, static: Any, points: Any, said: str) -> None:
        with pytest.raises(SceneError, match=rf"gusts\.json: .*{said}"):
            WeakestGusts.of({"static": static, "points": points})
