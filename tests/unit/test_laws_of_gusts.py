"""Laws of the velocity at a grain: levels, rates, measured series, counted gusts, and gusts that last."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from incipient.errors import SceneError
from incipient.thresholds.lasting import Series, WeakestGusts, rate_of_lasting, series_of
from incipient.thresholds.laws import Events, Gaussian, Measured

PROBABILITIES = (0.001, 0.01, 0.05, 0.5)


class TestLaws:
    def test_levels(self) -> None:
        # exp(z s - s^2/2) with s^2 = log(1.09), or 1 + 0.3 z, with z of the Gaussian: 3.0902, 2.3263, 1.6449, 0.
        levels = [Gaussian(0.3).level(one) for one in PROBABILITIES]
        assert levels == pytest.approx((2.3728, 1.8962, 1.5524, 0.9578), abs=5e-5)
        normal = [Gaussian(0.3, lognormal=False).level(one) for one in PROBABILITIES]
        assert normal == pytest.approx((1.927070, 1.697904, 1.493456, 1.0), abs=1e-6)
        assert Gaussian(0.3).upcrossings(1.5) is None  # without a microscale

    @pytest.mark.parametrize("lognormal", [True, False])
    def test_mean_and_intensity(self, lognormal: bool) -> None:
        nodes, weights = np.polynomial.hermite_e.hermegauss(60)
        factors = Gaussian(0.3, lognormal).factor(nodes)
        mean = weights @ factors / weights.sum()
        assert mean == pytest.approx(1.0, abs=1e-12)
        assert weights @ (factors - 1.0) ** 2 / weights.sum() == pytest.approx(0.09, rel=1e-10)

    @pytest.mark.parametrize("lognormal", [True, False])
    def test_upcrossings_of_a_series_with_a_stated_microscale(self, lognormal: bool) -> None:
        # A Gaussian process with the correlation exp(-(t/lambda)^2), made of its spectrum exp(-(omega lambda)^2/4).
        law, step, count = Gaussian(0.3, lognormal, microscale=0.5), 0.05, 2**21
        angular = 2.0 * np.pi * np.fft.rfftfreq(count, step)
        amplitude = np.exp(-((angular * 0.5) ** 2) / 8.0)
        noise = np.random.default_rng(3).standard_normal((2, len(angular)))
        values = np.fft.irfft(amplitude * (noise[0] + 1j * noise[1]), count)
        factors = law.factor(values / values.std())
        for level in (1.0, 1.3, 1.6):
            rises = np.count_nonzero((factors[:-1] <= level) & (factors[1:] > level))
            expected = law.upcrossings(level)
            assert expected is not None
            # Three standard errors of the count, and what steps of lambda/10 miss.
            assert rises == pytest.approx(
                expected * count * step, rel=3.0 / math.sqrt(rises) + 0.01
            )


class TestMeasured:
    def test_share_of_the_time_and_rate_of_a_sine(self) -> None:
        times = np.linspace(0.0, 200.0 * np.pi, 200_001)
        law = Measured.of(np.column_stack([times, 3.0 + 1.5 * np.sin(times)]), integral_time=1.0)
        assert law.intensity == pytest.approx(0.5 / math.sqrt(2.0), rel=1e-6)
        # 1 + sin(t)/2 is above 1.25 from pi/6 to 5 pi/6: a third of the time, once in each period.
        assert law.exceeded(1.25) == pytest.approx(1.0 / 3.0, abs=1e-5)
        assert law.level(1.0 / 3.0) == pytest.approx(1.25, abs=1e-4)
        assert law.upcrossings(1.25) == pytest.approx(0.5 / np.pi, rel=1e-9)

    def test_integral_time_of_a_series(self) -> None:
        # Values held for unit times that are independent: a triangular correlation, whose integral is 1/2.
        values = np.random.default_rng(1).lognormal(size=20_000)
        times = np.arange(200_000) * 0.1
        law = Measured.of(np.column_stack([times, np.repeat(values, 10)]), None)
        assert law.integral == pytest.approx(0.5, rel=0.1)

    def test_series_too_short_is_refused(self) -> None:
        times = np.linspace(0.0, 10.0, 200)
        with pytest.raises(
            SceneError, match=r"gusts\.points: the series lasts 10, less than 20 times.*longer"
        ):
            Measured.of(np.column_stack([times, 1.0 + 0.1 * np.sin(times)]), integral_time=1.0)

    def test_levels_of_a_series_that_stays_at_its_lowest_value(self) -> None:
        """Half of the time at 0.5, then at 1.5, of mean 1: by hand 1.5 with 0.4, and 0.5 with 0.6 or more."""
        times = np.arange(0.0, 1000.0, 0.25)
        values = np.where((times // 5.0) % 2.0 < 1.0, 0.5, 1.5)
        law = Measured.of(np.column_stack([times, values]), integral_time=1.0)
        low, high = law.factors.min(), law.factors.max()
        assert law.level(0.6) == law.level(0.9) == low == pytest.approx(0.5, rel=1e-3)
        assert law.level(0.4) == pytest.approx(high, rel=0.1)

    def test_probability_beyond_the_series_is_refused(self) -> None:
        times = np.linspace(0.0, 200.0, 2001)
        law = Measured.of(np.column_stack([times, 2.0 + np.sin(times)]), integral_time=1.0)
        with pytest.raises(
            SceneError, match=r"0\.001 is outside the range of the series, 0\.01 to 0\.99"
        ):
            law.level(0.001)


class TestEvents:
    """Four gusts, counted by hand, and many of a stated law."""

    LAW = Events.of(np.array([[1.2, 3.0], [2.0, 0.5], [1.5, 1.0], [1.8, 0.5]]), 100.0)

    def test_shares_and_rates_are_those_counted(self) -> None:
        assert [self.LAW.exceeded(one) for one in (1.0, 1.4, 1.8, 2.5)] == pytest.approx(
            [0.05, 0.02, 0.005, 0.0]
        )
        assert self.LAW.upcrossings(1.4) == pytest.approx(0.03)
        assert self.LAW.level(0.02) == pytest.approx(1.5) and self.LAW.known_range == pytest.approx(
            (0.005, 0.05)
        )
        # The sum of a Poisson number of lengths has the variance of the sum of their squares: 0.25 + 0.25 + 1.
        assert self.LAW.spread(0.02) == pytest.approx(math.sqrt(1.5) / 100.0)

    def test_records_made_anew_scatter_by_the_spread(self) -> None:
        """Gusts of exponential lengths that come by chance, 100 in a record on average, two fifths above a level."""
        chance = np.random.default_rng(11)
        shares, spreads = [], []
        for _ in range(2000):
            count = chance.poisson(100)
            points = np.column_stack(
                [chance.uniform(1.0, 2.0, count), chance.exponential(0.5, count)]
            )
            law = Events.of(points, 1000.0)
            shares.append(law.exceeded(1.6))
            spreads.append(law.spread(shares[-1]))
        assert np.mean(spreads) == pytest.approx(np.std(shares), rel=0.05)

    def test_where_no_gust_is_above_a_few_may_have_been_missed(self) -> None:
        """Three may be expected where none came, with 5% (Poisson); they last 1.25 in the mean."""
        assert self.LAW.spread(0.0) == pytest.approx(3.0 * 1.25 / 100.0)

    @pytest.mark.parametrize("probability", [0.001, 0.06])
    def test_probabilities_beyond_them_are_refused(self, probability: float) -> None:
        with pytest.raises(
            SceneError, match=r"gusts\.points: probability .* outside the range of the events"
        ):
            self.LAW.level(probability)

    def test_gusts_that_last_are_those_above_the_curve(self) -> None:
        # The weakest gusts: 1.9 for 0.4, 1.4 for 2. Of the four, 2.0 for 0.5 is above it.
        weakest = WeakestGusts(np.array([0.4, 2.0]), np.array([1.9, 1.4]), np.zeros(2), 1.1)
        assert rate_of_lasting(self.LAW, weakest, 1.0).rate == pytest.approx(0.01)
        # In a mean flow 1.25 times as strong they are 2.5, 2.25, 1.875 and 1.5: of 0.5, 0.5, 1 and 3.
        assert rate_of_lasting(self.LAW, weakest, 1.25).rate == pytest.approx(0.04)

    def test_events_of_a_lognormal_law_give_its_levels(self) -> None:
        """Pieces of one length whose strengths are lognormal, of intensity 0.3: 1.8962 is exceeded with 1%."""
        strengths = np.random.default_rng(5).lognormal(
            -0.5 * math.log(1.09), math.sqrt(math.log(1.09)), 200_000
        )
        law = Events.of(
            np.column_stack([strengths, np.full(len(strengths), 0.5)]), 0.5 * len(strengths)
        )
        assert law.level(0.01) == pytest.approx(1.8962, rel=3.0 * 0.0025)
        assert law.upcrossings(1.8962) == pytest.approx(0.02, rel=0.1)


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

    @pytest.mark.parametrize(
        ("integral", "said"),
        [(None, "is missing"), (0.7, r"is 0\.7, less than the microscale 0\.5")],
    )
    def test_times_that_no_correlation_has_are_refused(self, integral: Any, said: str) -> None:
        """T1 + T2 is at least the root of 4 T1 T2, the microscale times the root of two."""
        with pytest.raises(SceneError, match=rf"gusts\.integral_time: {said}"):
            series_of(Gaussian(0.3, True, 0.5), integral)

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
