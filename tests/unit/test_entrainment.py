"""Gusts and the probability of entrainment."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from incipient import make_plan
from incipient.contact import Contacts, Load
from incipient.contact.safety import safety_factor
from incipient.errors import SceneError
from incipient.scene import load
from incipient.scene.file import loads
from incipient.setup.setup import Setup
from incipient.thresholds.acceleration import CriticalStrength, load_of_growth
from incipient.thresholds.entrainment import Entrainment, Motion, find_entrainment
from incipient.thresholds.lasting import Series, WeakestGusts, rate_of_lasting, series_of
from incipient.thresholds.laws import Events, Gaussian, Measured
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


POINTS = ", ".join(["[1.5, 1.0]"] * 20)
EVENTS = f'law = "events"\nrecord = 100.0\npoints = [{POINTS}'
REFUSED = [
    ("", "gusts.intensity: is missing; give a number"),
    ("intensity = -0.1", "gusts.intensity"),
    ("intensity = 0", 'is 0; give a number above zero, or "near-wall" or "model"'),
    (
        'intensity = "nearwall"',
        'is "nearwall"; give a number above zero, or "near-wall" or "model"',
    ),
    (
        'intensity = 0.3\nmicroscale = "modell"',
        'is "modell"; give a number above zero, or "model"',
    ),
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
    with pytest.raises(SceneError) as error:
        loads(POCKET.replace("intensity = 0.3", keys))
    assert said in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("keys", "count"), [('law = "measured"', 200), ('law = "events"\nrecord = 100.0', 20)]
)
def test_data_from_a_file(tmp_path: Path, keys: str, count: int) -> None:
    rows = "\n".join(f"{0.1 + 0.5 * k},{1.0 + 0.3 * math.sin(k)}" for k in range(count))
    (tmp_path / "data.csv").write_text(f"first,second\n{rows}\n")
    text = POCKET.replace("intensity = 0.3", f'{keys}\nfile = "data.csv"')
    (tmp_path / "scene.toml").write_text(text)
    gusts = load(tmp_path / "scene.toml").gusts
    assert gusts is not None and len(gusts.points) == count and gusts.file is None


def test_model_without_a_model_is_refused() -> None:
    setup = Setup(loads(POCKET.replace("intensity = 0.3", 'intensity = "model"')))
    assert setup.scene.gusts is not None
    with pytest.raises(SceneError, match=r'gusts\.intensity: "model" needs a turbulence model'):
        MeanFlow(setup, setup.scene.gusts)


def test_intensity_near_walls_is_that_of_the_viscous_layer_in_a_slow_shear() -> None:
    # u'/u* = 0.49 k+ at the top of the grain, where the velocity is u* k+ times its height above the datum over d.
    setup = Setup(loads(POCKET.replace("intensity = 0.3", 'intensity = "near-wall"')))
    gusts, placement = setup.scene.gusts, setup.scene.placement
    assert gusts is not None and placement is not None
    top = placement.centre[1] + 0.5 - setup.base_flow.datum
    assert MeanFlow(setup, gusts).intensity(1e-8) == pytest.approx(0.49 / top, rel=0.02)


def test_scales_of_the_model_are_those_of_isotropic_turbulence() -> None:
    """k = 1.5 u'^2; lambda^2 = 2 u'^2/<(du/dx)^2> with epsilon = 15 nu <(du/dx)^2>; both over the mean velocity."""
    stone = Path(__file__).parents[2] / "demos" / "scenes" / "stone_in_turbulence.toml"
    words = [f'gusts.{name}="model"' for name in ("intensity", "microscale", "integral_time")]
    setup = Setup(load(stone, words))
    assert setup.scene.gusts is not None
    stream = MeanFlow(setup, setup.scene.gusts)
    intensity, lasts = stream.intensity(1.0), stream.microscale(1.0)
    length = stream.integral_time(1.0)
    assert lasts is not None and length is not None
    fluctuation = (intensity * stream.speed) ** 2
    epsilon = 0.43 * (1.5 * fluctuation) ** 1.5 / (length * stream.speed)
    slope = epsilon / (15.0 * setup.scene.viscosity)
    assert (lasts * stream.speed) ** 2 == pytest.approx(2.0 * fluctuation / slope, rel=1e-9)
    # Twice the flow at the same viscosity is the scene at twice the Reynolds number, whose times are halved.
    twice = Setup(load(stone, [*words, f"fluid.reynolds={2.0 * setup.scene.fluid.reynolds}"]))
    assert twice.scene.gusts is not None
    itself = MeanFlow(twice, twice.scene.gusts)
    for name in ("microscale", "integral_time"):
        halved = pytest.approx(0.5 * getattr(itself, name)(1.0), rel=1e-9)
        assert getattr(stream, name)(2.0) == halved


@pytest.mark.parametrize("intensity", ["model", "near-wall"])
def test_a_stronger_flow_has_the_turbulence_of_its_own_profile(intensity: str) -> None:
    """As a scene with that Reynolds number has it, in units of that flow: u* over the velocity falls with the speed."""
    sand = Path(__file__).parents[2] / "demos" / "scenes" / "sand_in_turbulence.toml"
    words = ["bed={kind='flat'}", f'gusts.intensity="{intensity}"']
    words += ['gusts.microscale="model"', 'gusts.integral_time="model"']

    def stream(*more: str) -> MeanFlow:
        setup = Setup(load(sand, [*words, *more]))
        assert setup.scene.gusts is not None
        return MeanFlow(setup, setup.scene.gusts)

    scene = stream()
    third = stream(f"fluid.reynolds={0.3 * scene.setup.scene.fluid.reynolds}")
    assert scene.intensity(0.3) == pytest.approx(third.intensity(1.0), rel=1e-6)
    assert abs(scene.intensity(0.3) / scene.intensity(1.0) - 1.0) > 0.1
    for name in ("microscale", "integral_time"):
        assert getattr(scene, name)(0.3) == pytest.approx(getattr(third, name)(1.0) / 0.3, rel=1e-6)


def test_a_base_flow_at_rest_at_the_grain_has_no_intensity_near_the_wall() -> None:
    """A disc of 0.2 in a trough of the bed, below the crests, from which the flow begins."""
    small = POCKET.replace("diameter = 1.0", "diameter = 0.2").replace(
        "intensity = 0.3", 'intensity = "near-wall"'
    )
    setup = Setup(loads(small))
    assert setup.scene.gusts is not None
    stream = MeanFlow(setup, setup.scene.gusts)
    with pytest.raises(SceneError, match="the base flow is at rest at the grain"):
        stream.require_intensity()


def test_intensity_by_a_model_to_the_wall_is_that_of_its_developed_flow() -> None:
    """sqrt(2k/3) over U, means over the disc's heights above the bed, of the developed flow in one dimension."""
    sand = Path(__file__).parents[2] / "demos" / "scenes" / "sand_in_turbulence.toml"
    words = [
        "bed={kind='flat'}",
        *(f'gusts.{name}="model"' for name in ("intensity", "microscale", "integral_time")),
    ]
    setup = Setup(load(sand, words))
    gusts, scene, walls = setup.scene.gusts, setup.scene, setup.walls
    assert gusts is not None and scene.grain is not None and scene.placement is not None
    half, centre = 0.5 * scene.grain.size, scene.placement.centre[1] - walls.ground
    # Strips of a disc, weighted by their widths.
    heights = centre + half * np.sin(np.linspace(-0.5, 0.5, 2001) * np.pi)
    weights = np.gradient(heights) * np.sqrt(np.maximum(half**2 - (heights - centre) ** 2, 0.0))
    flow, unit = walls.profile.channel, walls.shear_velocity
    at = heights / walls.depth
    speed = np.average(np.interp(at, flow.heights, flow.speed), weights=weights) * unit
    energy = np.average(
        np.exp(np.interp(np.log(np.maximum(at, 1e-6)), np.log(flow.heights[1:]), flow.log_k[1:])),
        weights=weights,
    )
    stream = MeanFlow(setup, gusts)
    assert stream.speed == pytest.approx(speed, rel=0.01)
    assert stream.intensity(1.0) == pytest.approx(
        np.sqrt(2.0 / 3.0 * energy) * unit / speed, rel=0.02
    )
    assert 0.1 < stream.intensity(1.0) < 0.5


def test_intensity_near_walls_has_its_limits() -> None:
    # Zanke (2003): 0.31 k+ + 0.18 k+ for small k+, 1.8 above rough beds far below the surface.
    assert near_wall(1e-3) == pytest.approx(0.49e-3, rel=1e-3)
    assert near_wall(300.0) == pytest.approx(1.8, rel=1e-9)
    assert near_wall(300.0, 0.5) == pytest.approx(1.8 * math.exp(-0.44), rel=1e-9)


def test_the_plan_of_a_run_says_that_gusts_are_not_in_it() -> None:
    assert "without [gusts], which incipient entrainment adds" in make_plan(loads(POCKET)).text()
    assert "[gusts]" not in make_plan(loads(POCKET[: POCKET.index("[gusts]")])).text()


class TestAcceleration:
    def growth(self, **changes: str) -> np.ndarray:
        """Load of growth of a uniform flow of speed one over the volume of the disc or sphere."""
        text = "\n".join(
            (
                f"[domain]\n{changes['domain']}",
                '[fluid]\nreynolds = 10.0\nscale = "grain"\n[flow]\nkind = "uniform"',
                f"[body]\ndiameter = 1.0\n{changes['body']}",
                changes.get("bed", ""),
            )
        )
        scene = loads(text)
        assert scene.grain is not None
        return load_of_growth(Setup(scene), MPI.COMM_WORLD) / scene.grain.volume

    def test_disc_far_from_walls(self) -> None:
        # Added mass is that of the fluid displaced (Lamb 1932, section 68): the whole is twice it.
        found = self.growth(
            domain="length = 30.0\nheight = 30.0", body='shape = "disc"\ncentre = [15.0, 15.0]'
        )
        assert found[0] == pytest.approx(2.0, rel=3e-3)
        assert np.abs(found[1:]).max() < 1e-3

    def test_disc_next_to_a_plane(self) -> None:
        # By the images of a doublet in the disc and its mirror image, as Milne-Thomson (1968, section 8.81): each at
        # 1/d from the centre, weaker by 1/d^2. At a gap of zero the whole is pi^2/3.
        away, strength, expected = 2.0 * 1.0002, 1.0, 2.0
        apart = away
        while strength > 1e-14:
            strength /= apart**2
            expected += 2.0 * strength
            apart = away - 1.0 / apart
        found = self.growth(
            domain="length = 60.0\nheight = 30.0",
            body='shape = "disc"\nx = 30.0',
            bed='[bed]\nkind = "flat"\n[contact]\nfriction = 0.5\ngap = 1e-4',
        )
        assert expected == pytest.approx(3.25044, abs=1e-5)
        assert found[0] == pytest.approx(expected, rel=2e-3)

    @pytest.mark.slow
    def test_sphere_that_touches_a_plane(self) -> None:
        # Added mass 0.621 along the plane (Milne-Thomson 1968, section 16.41, of two spheres that touch).
        found = self.growth(
            domain="length = 24.0\nwidth = 20.0\nheight = 12.0",
            body='shape = "sphere"\nx = 12.0',
            bed='[bed]\nkind = "flat"\n[contact]\nfriction = 0.5\ngap = 1e-3',
        )
        assert found[0] == pytest.approx(1.621, rel=5e-3)

    def test_critical_strength_of_a_flow_that_grows(self) -> None:
        # A push through the centre in a symmetric pocket: lost at a push F, be it of the flow or of its growth.
        normals = np.array([[math.sin(one), -math.cos(one), 0.0] for one in (-0.5, 0.5)])
        contacts = Contacts(0.5 * normals, normals)
        weight = np.array([0.0, -1.0, 0.0])
        push = np.array(
            [
                safety_factor(Load([1.0, 0, 0], [0, 0, 0], weight, [0, 0, 0]), contacts, 0.3).value,
                0,
                0,
            ]
        )
        load = Load(push, [0, 0, 0], weight, [0, 0, 0])
        growth = np.concatenate([0.4 * push, np.zeros(3)])
        steady: Any = SimpleNamespace(factor=2.0, load=load, steepness=2.0, contacts=contacts)
        critical = CriticalStrength(steady, growth, 0.3)
        assert critical.at(0.0, relative=False) == pytest.approx(2.0, rel=1e-6)
        # (x/2)^2 + 0.4 = 1, and (x/2)^2 + 0.4 x = 1.
        assert critical.at(1.0, relative=False) == pytest.approx(2.0 * math.sqrt(0.6), rel=1e-6)
        assert critical.at(1.0, relative=True) == pytest.approx(
            2.0 * (math.sqrt(1.16) - 0.4), rel=1e-6
        )


@pytest.fixture(scope="module")
def found() -> Entrainment:
    return find_entrainment(Setup(loads(POCKET)), MPI.COMM_WORLD)


class TestEntrainment:
    def test_mean_flows_are_the_critical_one_over_the_levels(self, found: Entrainment) -> None:
        levels = [2.37282, 1.89617, 1.55236, 0.95783]  # see test_entrainment.py
        strengths = [one.strength for one in found.quantiles]
        assert strengths == pytest.approx(
            [found.threshold.factor / level for level in levels], rel=1e-5
        )
        # The stress of a laminar shear goes with its strength.
        for one in found.quantiles:
            assert one.shields / found.threshold.shields == pytest.approx(
                one.strength / found.threshold.factor, rel=1e-6
            )

    def test_errors_are_of_the_flow_and_of_the_law(self, found: Entrainment) -> None:
        first = found.quantiles[0]
        bars = found.threshold.bars
        assert bars is not None
        share = (
            max(bars.high, 2.0 * found.threshold.factor - bars.low) / found.threshold.factor - 1.0
        )
        assert first.terms["flow"] == pytest.approx(first.shields * share, rel=0.05)
        # The normal law needs a flow stronger by 2.37282/1.92707.
        assert first.terms["law of fluctuations"] == pytest.approx(
            first.shields * (2.37282 / 1.92707 - 1.0), rel=1e-4
        )
        assert first.error == pytest.approx(sum(first.terms.values()))

    def test_curve_rises_and_scene_is_on_it(self, found: Entrainment) -> None:
        probabilities = [one.probability for one in found.curve]
        assert probabilities == sorted(probabilities)
        own = found.scene
        assert own.probability == pytest.approx(
            Gaussian(0.3).exceeded(found.threshold.factor), rel=1e-9
        )
        assert own.low <= own.probability <= own.high and own.rate is None
        # The normal law of the same intensity, far out less probable, is within the range.
        assert (
            own.low
            <= Gaussian(0.3, lognormal=False).exceeded(found.threshold.factor)
            < own.probability
        )

    def motion(self, found: Entrainment, words: str, **changes: Any) -> Motion:
        """The motion of the disc by other gusts about the threshold that was found, or one that is changed."""
        scene = loads(POCKET.replace("intensity = 0.3", words))
        assert scene.gusts is not None
        threshold = replace(found.threshold, **changes)
        flow = MeanFlow(Setup(scene), scene.gusts)
        return Motion(scene.gusts, flow, threshold, threshold.factor)

    def test_a_normal_law_that_does_not_reach_a_probability(self, found: Entrainment) -> None:
        """The factor is above zero with the probability of 1/I deviations: 0.977 at 0.5."""
        motion = self.motion(found, 'law = "normal"\nintensity = 0.5')
        with pytest.raises(
            SceneError, match=r"probabilities: 0\.99 is not reached in any mean flow"
        ):
            motion.quantile(0.99)
        ended = motion.strength(motion.nearest(0.99))
        assert ended == pytest.approx(10.0 * found.threshold.factor, rel=1e-6)
        # A lognormal factor reaches it; what a normal one would need is without bound.
        quantile = self.motion(found, "intensity = 0.5").quantile(0.99)
        assert quantile.terms["law of fluctuations"] == math.inf and math.isfinite(quantile.shields)

    def test_a_series_that_flows_back(self, found: Entrainment) -> None:
        """A sine of mean 1 and amplitude 2 is above zero in two thirds of the time: others move in no flow."""
        times = np.arange(4000) * 0.25
        rows = ", ".join(f"[{t}, {1.0 + 2.0 * math.sin(t)}]" for t in times)
        motion = self.motion(found, f'law = "measured"\npoints = [{rows}]')
        with pytest.raises(
            SceneError, match=r"probabilities: 0\.8 is not reached in any mean flow"
        ):
            motion.quantile(0.8)
        assert motion.strength(motion.nearest(0.8)) == pytest.approx(
            10.0 * found.threshold.factor, rel=1e-3
        )

    def test_a_threshold_without_an_upper_bound(self, found: Entrainment) -> None:
        assert found.threshold.bars is not None
        motion = self.motion(
            found, "intensity = 0.3", bars=replace(found.threshold.bars, high=math.inf)
        )
        assert motion.at(2.0).low == 0.0
        assert motion.quantile(0.01).terms["flow"] == math.inf

    def test_usual_probabilities_that_events_cannot_tell_are_left_out(self) -> None:
        """A hundred gusts for half a unit of time each, in 500: probabilities from 0.001 to 0.1."""
        rows = ", ".join(f"[{1.0 + 0.05 * k}, 0.5]" for k in range(1, 101))
        words = f'law = "events"\nrecord = 500.0\npoints = [{rows}]'
        told = find_entrainment(
            Setup(loads(POCKET.replace("intensity = 0.3", words))), MPI.COMM_WORLD
        )
        assert [one.probability for one in told.quantiles] == [0.001, 0.01, 0.05]
        assert told.assumed[-1] == "omitted, since the data do not resolve them: probabilities 0.5"

    def test_without_acceleration_slow_changes_are_the_limit(self, found: Entrainment) -> None:
        # With a long microscale the load of acceleration vanishes.
        scene = loads(POCKET + "microscale = 1000.0\n")
        assert scene.gusts is not None and scene.contact is not None
        growth = load_of_growth(Setup(scene), MPI.COMM_WORLD)
        growing = CriticalStrength(found.threshold, growth, 0.6)
        flow = MeanFlow(Setup(scene), scene.gusts)
        motion = Motion(scene.gusts, flow, found.threshold, found.threshold.factor, growing)
        assert motion.strength(0.01) == pytest.approx(found.quantiles[1].strength, rel=1e-4)

    def test_scenes_that_lack_something(self) -> None:
        text = POCKET[: POCKET.index("[gusts]")]
        with pytest.raises(SceneError, match=r"gusts: is missing; add \[gusts\]"):
            find_entrainment(Setup(loads(text)), MPI.COMM_WORLD)
        shallow = POCKET.replace("intensity = 0.3", 'intensity = "near-wall"\ndepth = 0.01')
        with pytest.raises(
            SceneError, match=r"gusts\.depth: is 0\.01, less than the grain's size of 1"
        ):
            find_entrainment(Setup(loads(shallow)), MPI.COMM_WORLD)
        with pytest.raises(
            SceneError, match="probabilities: give one or more, each between 0 and 1"
        ):
            find_entrainment(Setup(loads(POCKET)), MPI.COMM_WORLD, probabilities=[1.5])


# Laws of the velocity at a grain: levels, rates, measured series, counted gusts, and gusts that last.


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
