"""Gusts and the probability of entrainment."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from scenes import SCENES, message

from incipient import make_plan
from incipient.arrays import NO_EVENT
from incipient.errors import SceneError
from incipient.scene import Scene, load
from incipient.scene.file import loads
from incipient.setup.setup import Setup
from incipient.thresholds.entrainment import (
    Entrainment,
    Motion,
    find_entrainment,
    motion_of,
)
from incipient.thresholds.laws import (
    Gaussian,
    Record,
    WeakestGusts,
    events,
    measured,
    rate_of_lasting,
    record_of,
)
from incipient.thresholds.mean_flow import MeanFlow, near_wall

# Motion in a fluctuating flow: the stream at a grain, its acceleration, probabilities of motion and errors.


POCKET = """
title = "disc between half-discs, Stokes flow"
[domain]
length = 8.0
height = 4.0
[fluid]
reynolds = 20.0
scale = "grain"
inertia = false
[flow]
kind = "shear"
[bed]
kind = "half-discs"
radius = 0.5
spacing = 1.0
[body]
shape = "disc"
diameter = 1.0
x = 3.5
settle = true
density = 2.65
[gravity]
acceleration = 10.0
[contact]
friction = 0.6
[numerics]
mesh_size = 3.0
[gusts]
intensity = 0.3
"""
NEAR_WALL = 'intensity = "near-wall"'


def in_pocket(gusts: str) -> Scene:
    """The scene of `POCKET` with other gusts."""
    return loads(POCKET.replace("intensity = 0.3", gusts))


def mean_flow(scene: Scene) -> MeanFlow:
    assert scene.gusts is not None
    return MeanFlow(Setup(scene), scene.gusts)


POINTS = ", ".join(["[1.5, 1.0]"] * 20)
EVENTS = f'law = "events"\nrecord = 100.0\npoints = [{POINTS}'
REFUSED = [
    ("", "gusts.intensity: is missing; give a number"),
    ("intensity = -0.1", "gusts.intensity"),
    ("intensity = 0", 'is 0; give a number greater than 0 or use "near-wall" or "model"'),
    (
        'intensity = "nearwall"',
        'is "nearwall"; give a number or use "near-wall" or "model"',
    ),
    ('intensity = 0.3\nmicroscale = "model"', "gusts.microscale: "),
    ("intensity = 0.3\nintegral_time = 1.0", "integral_time: is given without microscale"),
    ("intensity = 0.3\nmicroscale = 1.0\nintegral_time = 1.2", "square root of two"),
    ("intensity = 0.3\ndepth = 3.0", "gusts.depth: is read only with"),
    ("intensity = 0.3\npoints = [[0.0, 1.0]]", "are not read with law"),
    ("intensity = 0.3\nrecord = 100.0", "gusts.record: is read only with"),
    ('law = "measured"', "points: are 0; give 100 or more, or a file"),
    ('law = "measured"\npoints = [[0.0, 1.0], [1.0, 2.0]]', "are 2; give 100 or more"),
    ('law = "events"\nrecord = 100.0\npoints = [[1.5, 1.0]]', "gusts.points: are 1"),
    (EVENTS.replace("record = 100.0\n", "") + "]", "gusts.record: is missing"),
    (EVENTS.replace("100.0", "10.0") + "]", "gusts.record: is 10, less than the total"),
    (EVENTS + "]\nintensity = 0.3", "gusts.intensity"),
    (EVENTS + ", [1.5, 0.0]]", "gusts.points: have a strength or duration"),
]


@pytest.mark.parametrize(("keys", "said"), REFUSED)
def test_wrong_keys_in_one_line(keys: str, said: str) -> None:
    assert said in message(lambda: in_pocket(keys))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (POCKET[: POCKET.index("[gusts]")], r"gusts: is missing; add \[gusts\]"),
        (
            POCKET.replace("intensity = 0.3", f"{NEAR_WALL}\ndepth = 0.01"),
            r"gusts\.depth: is 0\.01, less than the grain's size of 1",
        ),
        (
            POCKET.replace("intensity = 0.3", 'intensity = "model"'),
            r'gusts\.intensity: "model" needs a turbulence model',
        ),
        # A disc of 0.2 in a trough of the bed, below the crests, from which the flow begins.
        (
            POCKET.replace("diameter = 1.0", "diameter = 0.2").replace(
                "intensity = 0.3", NEAR_WALL
            ),
            "the base flow is at rest at the grain",
        ),
    ],
)
def test_scenes_without_an_intensity_are_refused(text: str, said: str) -> None:
    with pytest.raises(SceneError, match=said):
        find_entrainment(Setup(loads(text)), MPI.COMM_WORLD)


@pytest.mark.parametrize(
    ("numbers", "intensity"),
    [
        ((1e-3,), pytest.approx(0.49e-3, rel=1e-3)),
        ((300.0,), pytest.approx(1.8, rel=1e-9)),
        ((300.0, 0.5), pytest.approx(1.8 * math.exp(-0.44), rel=1e-9)),
    ],
)
def test_intensity_near_walls(numbers: tuple[float, ...], intensity: Any) -> None:
    """Zanke (2003): 0.31 k+ + 0.18 k+ for small k+, 1.8 above rough beds far below the surface."""
    assert near_wall(*numbers) == intensity


def test_intensity_in_a_slow_shear() -> None:
    """u'/u* = 0.49 k+ at the top of the grain, where the velocity is u* k+ times its height over d."""
    flow = mean_flow(in_pocket(NEAR_WALL))
    placement = flow.setup.scene.placement
    top = placement.centre[1] + 0.5 - flow.setup.base_flow.datum
    assert flow.intensity(1e-8) == pytest.approx(0.49 / top, rel=0.02)


@pytest.mark.parametrize("intensity", ["model", "near-wall"])
def test_a_stronger_flow_has_the_turbulence_of_its_own_profile(intensity: str) -> None:
    """As a scene with that Reynolds number has it, in units of that flow: u* over the velocity falls with the speed."""
    words = ["bed={kind='flat'}", f'gusts.intensity="{intensity}"']
    scene = load(SCENES / "sand_in_turbulence.toml", words)
    words.append(f"fluid.reynolds={0.3 * scene.fluid.reynolds}")
    flow, third = mean_flow(scene), mean_flow(load(SCENES / "sand_in_turbulence.toml", words))
    assert flow.intensity(0.3) == pytest.approx(third.intensity(1.0), rel=1e-6)
    assert abs(flow.intensity(0.3) / flow.intensity(1.0) - 1.0) > 0.1


def test_intensity_by_a_model_to_the_wall_is_that_of_its_developed_flow() -> None:
    """sqrt(2k/3) over U, means over the disc's heights above the bed, of the developed flow in one dimension."""
    scene = load(
        SCENES / "sand_in_turbulence.toml", ["bed={kind='flat'}", 'gusts.intensity="model"']
    )
    flow = mean_flow(scene)
    walls = flow.setup.walls
    half, centre = 0.5 * scene.grain.size, scene.placement.centre[1] - walls.datum
    # Strips of a disc, weighted by their widths.
    heights = centre + half * np.sin(np.linspace(-0.5, 0.5, 2001) * np.pi)
    weights = np.gradient(heights) * np.sqrt(np.maximum(half**2 - (heights - centre) ** 2, 0.0))
    channel, unit, at = walls.profile.channel, walls.shear_velocity, heights / walls.depth
    speed = np.average(np.interp(at, channel.heights, channel.speed), weights=weights) * unit
    logarithms = np.log(np.maximum(at, 1e-6)), np.log(channel.heights[1:]), channel.log_k[1:]
    energy = np.average(np.exp(np.interp(*logarithms)), weights=weights)
    assert flow.speed == pytest.approx(speed, rel=0.01)
    expected = np.sqrt(2.0 / 3.0 * energy) * unit / speed
    assert flow.intensity(1.0) == pytest.approx(expected, rel=0.02)
    assert 0.1 < flow.intensity(1.0) < 0.5


def test_the_plan_of_a_run_says_that_gusts_are_not_in_it() -> None:
    assert "without [gusts], which incipient entrainment adds" in make_plan(loads(POCKET)).text()
    assert "[gusts]" not in make_plan(loads(POCKET[: POCKET.index("[gusts]")])).text()


@pytest.fixture(scope="module")
def entrained() -> Entrainment:
    return find_entrainment(Setup(loads(POCKET)), MPI.COMM_WORLD)


def motion_by(entrained: Entrainment, gusts: str, **changes: Any) -> Motion:
    """The motion of the disc by other gusts about its threshold, or one that is changed."""
    flow, threshold = mean_flow(in_pocket(gusts)), replace(entrained.threshold, **changes)
    return motion_of(flow.gusts, flow, threshold)


def test_mean_flows_are_the_critical_one_over_the_levels(entrained: Entrainment) -> None:
    """Levels as in `test_levels_of_each_law`; the stress of a laminar shear is proportional to its strength."""
    threshold, quantiles = entrained.threshold, entrained.quantiles
    levels = np.array([2.37282, 1.89617, 1.55236, 0.95783])
    strengths = np.array([point.strength for point in quantiles])
    assert strengths == pytest.approx(threshold.factor / levels, rel=1e-5)
    stresses = [point.shields / threshold.shields for point in quantiles]
    assert stresses == pytest.approx(strengths / threshold.factor, rel=1e-6)


def test_errors_are_of_the_flow_and_of_the_law(entrained: Entrainment) -> None:
    first, factor = entrained.quantiles[0], entrained.threshold.factor
    bars = entrained.threshold.bars
    share = max(bars.high, 2.0 * factor - bars.low) / factor - 1.0
    assert first.terms["flow"] == pytest.approx(first.shields * share, rel=0.05)
    # The normal law needs a flow stronger by 2.37282/1.92707.
    expected = first.shields * (2.37282 / 1.92707 - 1.0)
    assert first.terms["law of fluctuations"] == pytest.approx(expected, rel=1e-4)
    assert first.error == pytest.approx(sum(first.terms.values()))


def test_curve_rises_and_scene_is_on_it(entrained: Entrainment) -> None:
    """The normal law of the same intensity, far out less probable, is within the range."""
    probabilities = [point.probability for point in entrained.curve]
    assert probabilities == sorted(probabilities)
    own, factor = entrained.scene, entrained.threshold.factor
    assert own.probability == pytest.approx(Gaussian(0.3).exceeded(factor), rel=1e-9)
    assert own.low <= own.probability <= own.high and own.rate is None
    assert own.low <= Gaussian(0.3, lognormal=False).exceeded(factor) < own.probability


@pytest.mark.parametrize(
    ("gusts", "probability", "relative"),
    [
        # The factor is above zero with the probability of 1/I deviations: 0.977 at 0.5.
        ('law = "normal"\nintensity = 0.5', 0.99, 1e-6),
        # A sine of mean 1 and amplitude 2 is above zero in two thirds of the time: others move in no flow. Its
        # 16,000 pieces have levels 1.2% apart near a tenth of the mean, the end of the curve.
        (
            'law = "measured"\npoints = '
            f"{[[t, 1.0 + 2.0 * math.sin(t)] for t in (0.25 * k for k in range(4000))]}",
            0.8,
            0.02,
        ),
    ],
    ids=["normal", "sine"],
)
def test_a_law_that_does_not_reach_a_probability(
    entrained: Entrainment, gusts: str, probability: float, relative: float
) -> None:
    motion = motion_by(entrained, gusts)
    why = rf"probabilities: {probability} is not reached in any mean flow"
    with pytest.raises(SceneError, match=why):
        motion.quantile(probability)
    ended = motion.strength(motion.nearest(probability))
    assert ended == pytest.approx(10.0 * entrained.threshold.factor, rel=relative)


def test_mean_flows_may_have_errors_without_bound(entrained: Entrainment) -> None:
    """A normal law does not reach what a lognormal one does; a threshold may have no upper bound."""
    quantile = motion_by(entrained, "intensity = 0.5").quantile(0.99)
    assert quantile.terms["law of fluctuations"] == math.inf and math.isfinite(quantile.shields)
    assert entrained.threshold.bars is not None
    bars = replace(entrained.threshold.bars, high=math.inf)
    motion = motion_by(entrained, "intensity = 0.3", bars=bars)
    assert motion.at(2.0).low == 0.0 and motion.quantile(0.01).terms["flow"] == math.inf


def test_usual_probabilities_that_events_cannot_tell_are_left_out() -> None:
    """A hundred gusts for half a unit of time each, in 500: probabilities from 0.001 to 0.1."""
    rows = ", ".join(f"[{1.0 + 0.05 * k}, 0.5]" for k in range(1, 101))
    scene = in_pocket(f'law = "events"\nrecord = 500.0\npoints = [{rows}]')
    entrained = find_entrainment(Setup(scene), MPI.COMM_WORLD)
    assert [point.probability for point in entrained.quantiles] == [0.001, 0.01, 0.05]
    left_out = "omitted, since the data do not resolve them: probabilities 0.5"
    assert entrained.assumed[-1] == left_out


# Laws of the velocity at a grain: levels, rates, measured series, counted gusts, and gusts that last.


PROBABILITIES = (0.001, 0.01, 0.05, 0.5)


@pytest.mark.parametrize(
    ("lognormal", "levels"),
    [
        (True, pytest.approx((2.3728, 1.8962, 1.5524, 0.9578), abs=5e-5)),
        (False, pytest.approx((1.927070, 1.697904, 1.493456, 1.0), abs=1e-6)),
    ],
)
def test_levels_of_each_law(lognormal: bool, levels: Any) -> None:
    """exp(z s - s^2/2) with s^2 = log(1.09), or 1 + 0.3 z, with z of the Gaussian: 3.0902, 2.3263, 1.6449, 0."""
    law = Gaussian(0.3, lognormal)
    assert [law.level(probability) for probability in PROBABILITIES] == levels
    assert law.upcrossings(1.5) is None  # without a microscale


@pytest.mark.parametrize("lognormal", [True, False])
def test_upcrossings_of_a_series_with_a_stated_microscale(lognormal: bool) -> None:
    # A Gaussian process with the correlation exp(-(t/lambda)^2), made of its spectrum exp(-(omega lambda)^2/4).
    law, step, count = Gaussian(0.3, lognormal, microscale=0.5), 0.05, 2**21
    angular = 2.0 * np.pi * np.fft.rfftfreq(count, step)
    amplitude = np.exp(-((angular * 0.5) ** 2) / 8.0)
    noise = np.random.default_rng(3).standard_normal((2, len(angular)))
    values = np.fft.irfft(amplitude * (noise[0] + 1j * noise[1]), count)
    factors = law.factor(values / values.std())
    for level in (1.0, 1.3, 1.6):
        rises = np.count_nonzero((factors[:-1] <= level) & (factors[1:] > level))
        rate = law.upcrossings(level)
        assert rate is not None
        # Three standard errors of the count, and what steps of lambda/10 miss.
        allowed = 3.0 / math.sqrt(rises) + 0.01
        assert rises == pytest.approx(rate * count * step, rel=allowed)


def series(values: Any, times: np.ndarray, integral_time: float | None = 1.0) -> Record:
    return measured(np.column_stack([times, values]), integral_time)


def test_share_of_the_time_and_rate_of_a_sine() -> None:
    times = np.linspace(0.0, 200.0 * np.pi, 200_001)
    law = series(3.0 + 1.5 * np.sin(times), times)
    assert "intensity 0.354" in law.words  # 1/sqrt(8)
    # 1 + sin(t)/2 is above 1.25 from pi/6 to 5 pi/6: a third of the time, once in each period of 8000 pieces, of
    # which up to one may be on the other side.
    assert law.exceeded(1.25) == pytest.approx(1.0 / 3.0, abs=1.0 / 8000.0)
    assert law.level(1.0 / 3.0) == pytest.approx(1.25, abs=1e-4)
    assert law.upcrossings(1.25) == pytest.approx(0.5 / np.pi, rel=1e-9)


def test_integral_time_of_a_series() -> None:
    # Values held for unit times that are independent: a triangular correlation, whose integral is 1/2.
    values = np.random.default_rng(1).lognormal(size=20_000)
    law = series(np.repeat(values, 10), np.arange(200_000) * 0.1, None)
    assert law.independent is not None
    assert 0.5 * law.duration / law.independent == pytest.approx(0.5, rel=0.1)


def test_levels_of_a_series_that_stays_at_its_lowest_value() -> None:
    """Half of the time at 0.5, then at 1.5, of mean 1: by hand 1.5 with 0.4, and 0.5 with 0.6 or more."""
    times = np.arange(0.0, 1000.0, 0.25)
    law = series(np.where((times // 5.0) % 2.0 < 1.0, 0.5, 1.5), times)
    low, high = law.factors.min(), law.factors.max()
    assert law.level(0.6) == law.level(0.9) == low == pytest.approx(0.5, rel=1e-3)
    assert law.level(0.4) == pytest.approx(high, rel=0.1)


@pytest.mark.parametrize(
    ("end", "said"),
    [
        (10.0, r"gusts\.points: the series lasts 10, less than 20 times.*longer"),
        (200.0, r"0\.001 is outside the range of the series, 0\.01 to 0\.99"),
    ],
)
def test_what_a_series_is_too_short_for_is_refused(end: float, said: str) -> None:
    times = np.linspace(0.0, end, 2001)
    with pytest.raises(SceneError, match=said):
        series(2.0 + np.sin(times), times).level(0.001)


# Four gusts, counted by hand.

EVENTS = events(np.array([[1.2, 3.0], [2.0, 0.5], [1.5, 1.0], [1.8, 0.5]]), 100.0)


def test_shares_and_rates_are_those_counted() -> None:
    exceeded = [EVENTS.exceeded(level) for level in (1.0, 1.4, 1.8, 2.5)]
    assert exceeded == pytest.approx([0.05, 0.02, 0.005, 0.0])
    assert EVENTS.upcrossings(1.4) == pytest.approx(0.03)
    assert EVENTS.level(0.02) == pytest.approx(1.5)
    assert EVENTS.known_range == pytest.approx((0.005, 0.05))
    # The sum of a Poisson number of lengths has the variance of the sum of their squares, 10.5 of a total of 5: as
    # many samples are independent as are 2.1 long, not less than for the strongest gusts alone.
    assert EVENTS.spread(0.02) == pytest.approx(math.sqrt(0.02 * 0.98 * 2.1 / 100.0))
    assert EVENTS.spread(0.02) > math.sqrt(0.5**2 + 0.5**2 + 1.0**2) / 100.0
    # Three may be expected where none came, with 5% (Poisson).
    assert EVENTS.spread(0.0) == pytest.approx(3.0 * 2.1 / 100.0)


def test_gusts_that_last_are_those_above_the_curve() -> None:
    # The weakest gusts: 1.9 for 0.4, 1.4 for 2. Of the four, 2.0 for 0.5 is above it.
    weakest = WeakestGusts(np.array([0.4, 2.0]), np.array([1.9, 1.4]), np.zeros(2), 1.1)
    assert rate_of_lasting(EVENTS, weakest, 1.0).rate == pytest.approx(0.01)
    # In a mean flow 1.25 times as strong they are 2.5, 2.25, 1.875 and 1.5: of 0.5, 0.5, 1 and 3.
    assert rate_of_lasting(EVENTS, weakest, 1.25).rate == pytest.approx(0.04)


WEAKEST = WeakestGusts(np.array([0.5, 2.0]), np.array([4.0, 2.0]), np.zeros(2), static=1.5)


def test_gusts_are_counted_that_last_as_long_as_the_weakest() -> None:
    """Two of four do: between durations the logarithms are linear."""
    factors, step = np.ones(10_000), 0.01
    for start, end, strength in (
        (10, 10.6, 4.1),
        (20, 20.4, 4.1),
        (30, 32.2, 2.1),
        (40, 41, 2.1),
    ):
        factors[round(start / step) : round(end / step)] = strength
    lasting = rate_of_lasting(Record(factors, np.full(10_000, step)), WEAKEST, 1.0)
    assert lasting.rate * 10_000 * step == pytest.approx(2.0, rel=1e-3)
    assert lasting.low < lasting.rate < lasting.high
    assert np.interp(math.sqrt(8.0), *WEAKEST.needed()) == pytest.approx(1.0, rel=2e-3)
    WEAKEST.require_of(1.6)  # not far from the 1.5 of their own flow


@pytest.mark.parametrize(
    ("length", "strength", "may"), [(0.4, 4.1, 1), (0.4, 3.9, 0), (3.0, 1.6, 1), (1.9, 1.6, 0)]
)
def test_gusts_that_last_otherwise_than_those_searched_may_move_the_grain(
    length: float, strength: float, may: int
) -> None:
    """The weakest of 0.5 is 4, that of 2 is 2; a shorter one is stronger, a longer one between 2 and the steady 1.5."""
    factors = np.ones(10_000)
    factors[1000 : 1000 + round(length / 0.01)] = strength
    lasting = rate_of_lasting(Record(factors, np.full(10_000, 0.01)), WEAKEST, 1.0)
    assert (lasting.rate, lasting.low) == (0.0, 0.0)
    assert lasting.high * 100.0 == pytest.approx(2.0 if may else NO_EVENT)


def test_made_series_has_the_correlation_that_is_stated() -> None:
    microscale, integral = 0.5, 2.0
    course = record_of(Gaussian(0.3, False, microscale), integral)
    values = (course.factors - 1.0) / 0.3
    root = math.sqrt(integral**2 - 2.0 * microscale**2)
    first, second = 0.5 * (integral + root), 0.5 * (integral - root)
    for steps in (16, 64, 128):
        time = steps * course.lengths[0]
        parts = first * math.exp(-time / first) - second * math.exp(-time / second)
        correlation = np.mean(values[steps:] * values[:-steps])
        assert correlation == pytest.approx(parts / (first - second), abs=0.02)


POINT = {"duration": 1.0, "strength": 3.0, "error": 0.1}


def test_errors_that_are_not_known_are_not_taken_as_known() -> None:
    points = [POINT, POINT | {"duration": 2.0, "error": None}]
    weakest = WeakestGusts.of({"static": 1.5, "points": points})
    assert not weakest.known and weakest.errors.tolist() == [0.1, 0.0]
    assert WeakestGusts.of({"static": 1.5, "points": [POINT, POINT]}).known


@pytest.mark.parametrize(
    ("make", "said"),
    [
        *(
            (
                partial(EVENTS.level, probability),
                r"gusts\.points: probability .* outside the range of the events",
            )
            for probability in (0.001, 0.06)
        ),
        (lambda: record_of(Gaussian(0.3, True, 0.5), None), r"gusts\.integral_time: is missing"),
        (
            lambda: WEAKEST.require_of(2.3),
            r"gusts\.json: there a steady flow .* from 1\.5 on, here from 2\.3",
        ),
        *(
            (
                partial(WeakestGusts.of, {"static": static, "points": points}),
                rf"gusts\.json: .*{said}",
            )
            for static, points, said in (
                (1.5, [{"duration": 1.0, "error": 0.1}] * 2, "holds no gusts"),
                (None, [POINT] * 2, "holds no gusts"),
                (1.5, {"a": 1}, "holds no gusts"),
                (1.5, [POINT | {"error": 4.0}] * 2, "within its error"),
            )
        ),
    ],
)
def test_gusts_that_cannot_be_used_are_refused(make: Callable[[], Any], said: str) -> None:
    with pytest.raises(SceneError, match=said):
        make()
