"""Natural beds and flumes."""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scenes import ROOT, rows_of

import incipient
from incipient.errors import SceneError
from incipient.flumes import thresholds
from incipient.flumes.answer import OBSERVED, density_of_water, flume_scene, viscosity_of_water
from incipient.setup.base_flow import MeanProfile
from incipient.setup.setup import Setup
from incipient.survey.beds import Spheres
from incipient.thresholds.mean_flow import MeanFlow

pytestmark = pytest.mark.quick


# The natural bed of Shields' curve: pockets by geometry, weights, quantiles, and gusts over its mean profile.


@pytest.fixture(scope="module")
def natural_bed() -> Iterator[ModuleType]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "benchmarks"))
        yield import_module("natural_bed")


@pytest.fixture(scope="module")
def curve(natural_bed: ModuleType) -> ModuleType:
    return import_module("natural_bed_curve")


def square_bed() -> Spheres:
    """Beads in eight pockets, three apart, of a periodic layer of touching spheres on a square substrate."""
    layer = np.stack(np.meshgrid(np.arange(12.0), np.arange(6.0), [0.5]), axis=-1).reshape(-1, 3)
    beads = np.stack(np.meshgrid(0.5 + 3.0 * np.arange(4.0), [1.5, 4.5]), axis=-1).reshape(-1, 2)
    height = 0.5 + math.sqrt(0.5)
    centres = np.vstack([layer, np.column_stack([beads, np.full(len(beads), height)])])
    return Spheres(centres, np.full(len(centres), 0.5), np.array([12.0, 6.0]))


def bed_of(curve: ModuleType, steady: float) -> Any:
    """Three grains whose loads over bed stress are the same in all flows."""
    heights = np.array([0.3, 0.6, 0.9])
    return curve.NaturalBed(
        curve.MeanFlows(heights), np.array([0.0, 10.0, 1000.0]), np.full((3, 3), steady)
    )


@pytest.mark.parametrize("at", [0.0, 0.01])
@pytest.mark.parametrize("probability", [0.001, 0.5])
def test_in_the_viscous_layer_velocity_goes_as_stress(
    curve: ModuleType, at: float, probability: float
) -> None:
    """A gust of twice the velocity has twice the stress: levels of a lognormal factor of intensity 0.3, exactly."""
    bed = bed_of(curve, 0.04)
    shields, beyond = bed.shields(at, probability)
    factors = curve.factor(bed.flows.intensity(at), probability)
    assert shields == pytest.approx(0.04 / factors, rel=2e-3) and beyond == 0.0
    assert curve.factor(np.array([0.3]), 0.001) == pytest.approx([2.3728], abs=5e-5)


@pytest.mark.parametrize(("at", "factors"), [(1.0, [2.0, 2.0, 2.0]), (12.0, [0.8, 1.4, 2.5])])
def test_gusts_are_as_fast_as_asked_at_the_top(
    curve: ModuleType, at: float, factors: list[float]
) -> None:
    def speed(velocity: float, height: float) -> float:
        """Of the mean profile with a shear velocity, at a height."""
        profile = MeanProfile(1.0, 1.0 / velocity, 1.0, 5.0)
        return velocity * float(profile.speed(np.array([height]))[0])

    faster = bed_of(curve, 0.04).flows.as_fast(at, np.array(factors))
    for height, one, factor in zip((0.3, 0.6, 0.9), faster.tolist(), factors, strict=True):
        assert speed(one, height) / speed(at, height) == pytest.approx(factor, rel=3e-3)


def test_a_bed_without_gusts_moves_at_its_steady_numbers(curve: ModuleType) -> None:
    """A normal law is exceeded by its mean half of the time."""
    heights, levels = np.array([0.4, 0.8]), np.array([0.0, 5.0, 10.0])
    bed = curve.NaturalBed(
        curve.MeanFlows(heights), levels, np.array([[0.1, 0.05, 0.04], [np.inf, np.inf, 0.08]])
    )
    assert bed.shields(5.0, 0.5, lognormal=False)[0] == pytest.approx([0.05, np.inf])
    assert bed.shields(7.5, 0.5, lognormal=False)[0] == pytest.approx([1.0 / 22.5, 0.16], rel=1e-9)


def flows_by(
    curve: ModuleType, natural_bed: ModuleType, monkeypatch: pytest.MonkeyPatch, turbulent: int
) -> list[Any]:
    """Flows past nine grains at u* d/nu = 30, and turbulent ones past some that enter twice as fast at the top."""
    speed = natural_bed.top_speed(0.6, 30.0)
    made = [
        ("creeping", 0.0, 9, 0.6),
        ("laminar", 30.0, 9, speed),
        ("k-omega-sst", 30.0, turbulent, 2.0 * speed),
    ]
    loads = {name: 3.0 + place for place, name in enumerate(natural_bed.COMPONENTS)}
    rows = [
        {"pocket": float(number), "shear_reynolds": level, "model": name, "check": "", "speed": top}
        | {name: value * (1.0 + 0.1 * number) for name, value in loads.items()}
        for name, level, count, top in made
        for number in range(count)
    ]
    monkeypatch.setattr(natural_bed, "stored", lambda: rows)
    monkeypatch.setattr(natural_bed, "protrusion_of", lambda number: 0.6)
    bead = next(natural_bed.free_grains(square_bed(), 0.0))
    grains = [replace(bead, number=number) for number in range(9)]
    monkeypatch.setattr(natural_bed, "first_bed", lambda: (square_bed(), grains))
    result: list[Any] = curve.flow_loads()
    return result


def test_turbulent_loads_follow_from_laminar_ones(
    curve: ModuleType, natural_bed: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A flow that enters twice as fast at the top has a quarter of its loads over the bed's own stress."""
    creeping, laminar, fast = flows_by(curve, natural_bed, monkeypatch, 8)
    assert (laminar.below, fast.below, creeping.below) == (creeping, laminar, None)
    assert fast.model == "k-omega-sst" and fast.values == pytest.approx(0.25 * laminar.values[:8])
    known = np.zeros((1, 4)), np.zeros((1, 1))
    drawn = fast.drawn(known, laminar.values[-1:], np.random.default_rng(0))
    # The ninth grain has no run with turbulence: a quarter of its laminar load, as those of the others are.
    assert drawn == pytest.approx(0.25 * laminar.values[-1:])
    assert fast.error == pytest.approx(0.0, abs=1e-12)
    sample = curve.Sample([], np.empty(0, dtype=int), [creeping, laminar, fast])
    assert sample.levels == {0.0: creeping, 30.0: fast}
    fewer = sample.without(3).loads  # a fifth of the runs, of all flows
    assert [one.numbers for one in fewer] == 3 * [(0, 1, 2, 4, 5, 6, 7)]
    assert fewer[2].below is fewer[1] and fewer[1].below is fewer[0]
    few = flows_by(curve, natural_bed, monkeypatch, 4)
    assert [one.model for one in few] == ["creeping", "laminar"]


def test_a_run_begins_at_the_mean_level_of_its_bed(
    natural_bed: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    spheres = square_bed()
    grains = [one for one in natural_bed.free_grains(spheres, 0.0) if one.protrusion > 0.5]
    monkeypatch.setattr(natural_bed, "first_bed", lambda: (spheres, grains))
    made = natural_bed.scene(grains[0], 10.0, check="gap")
    above = made.body.centre[2] + 0.5 - made.flow.datum
    assert above == pytest.approx(grains[0].protrusion) and made.flow.kind == "log-law"
    assert made.fluid.reynolds == 10.0 and made.title.split("|")[1:] == ["10", "laminar", "gap"]
    assert natural_bed.scene(grains[0], 0.0).fluid.inertia is False


# `incipient flume`: thresholds by published curves, observed beds and the stored natural bed.


QUARTZ = {"viscosity": 1e-6, "fluid_density": 1000.0}


@pytest.mark.parametrize(
    ("temperature", "density", "viscosity"),
    [(0.0, 999.84, 1.7918e-3), (20.0, 998.21, 1.0016e-3), (25.0, 997.05, 0.8900e-3)],
)
def test_water_is_that_of_iapws(temperature, density, viscosity):
    """Table of IAPWS R12-08 for the viscosity [Pa s] at 25 °C; Lide, CRC Handbook, for the others."""
    assert density_of_water(temperature) == pytest.approx(density, rel=1e-5)
    dynamic = viscosity_of_water(temperature) * density_of_water(temperature)
    assert dynamic == pytest.approx(viscosity, rel=2e-4)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        # u* d/nu = 0.03 * 0.002/1e-6, theta = 0.0009/(1.65 * 9.81 * 0.002), D* = 0.002 (1.65 * 9.81 * 1e12)^(1/3)
        (
            {"shear_velocity": 0.03, **QUARTZ},
            {
                "shear_reynolds": 60.0,
                "shields": 0.027800,
                "dimensionless_diameter": 50.592,
                "bed_stress": 0.9,
            },
        ),
        # Uniform flow has the stress of its slope.
        (
            {"depth": 0.2, "slope": 1e-3, "gravity": 9.8},
            {"shear_velocity": math.sqrt(9.8 * 0.2 * 1e-3)},
        ),
    ],
)
def test_examples_by_hand(options, expected):
    answer = incipient.flume(2e-3, **options)
    assert {name: getattr(answer, name) for name in expected} == pytest.approx(expected, rel=1e-4)


def test_the_mean_velocity_is_that_of_the_rough_logarithmic_law():
    """Keulegan (1938): U/u* = ln(h/k_s)/kappa + 8.5 - 1/kappa; the profile is within 0.3 of Nikuradse's."""
    answer = incipient.flume(5e-3, depth=0.5, velocity=1.0, **QUARTZ)
    law = math.log(100.0) / 0.41 + 8.5 - 1.0 / 0.41
    assert answer.mean_velocity == pytest.approx(1.0)
    assert 1.0 / answer.shear_velocity == pytest.approx(law, abs=0.3)


def test_zanke_is_his_formula():
    """theta = (1 - n) tan(phi/1.5) K/((1 + 1.8 r)^2 (1 + 0.4 (1.8 u'/u*)^2 tan(phi/1.5) K)), n 0.35, phi 35 degrees.

    r = u'/u and u* d/nu as tabulated; K = 1 + 3e-8/((rho_s - rho) d^2); Zanke (2003).
    """
    tan = math.tan(math.radians(35.0 / 1.5))
    for row in range(0, 14, 2):
        size, reynolds, ratio, stored = (
            thresholds.stored("zanke_2003.csv")[name][row]
            for name in ("D_m", "Re_star", "turbulence_ratio", "D_star")
        )
        damped = math.exp(-0.1 * reynolds)
        fluctuation = 0.31 * reynolds * damped + 1.8 * (1.0 - damped)
        cohesion = 1.0 + 3e-8 / (1650.0 * size**2)
        below = (1.0 + 1.8 * ratio) ** 2 * (1.0 + 0.4 * (1.8 * fluctuation) ** 2 * tan * cohesion)
        assert thresholds.zanke(stored) == pytest.approx(0.65 * tan * cohesion / below, rel=0.01)
    assert thresholds.zanke(1.0) is None and thresholds.zanke(1200.0) is None


def test_percentiles_of_observed_beds_are_those_of_the_compilation():
    rows = [
        {name: float(row[name]) for name in ("shields", "d50", "density")}
        for row in rows_of(ROOT / "benchmarks/reference/shields_flume.csv")
    ]
    sizes = [
        row["d50"] * (9.81 * (row["density"] / 1000.0 - 1.0) * 1e12) ** (1 / 3) for row in rows
    ]
    ratios = np.array([row["shields"] for row in rows]) / thresholds.soulsby_whitehouse(
        np.array(sizes)
    )
    for percentile, ratio in zip(*thresholds.stored("observed_beds.csv").values(), strict=True):
        assert np.percentile(ratios, percentile) == pytest.approx(ratio, rel=2e-3)
    assert (min(sizes), max(sizes)) == pytest.approx(OBSERVED, rel=2e-3)
    told = [
        ", relative to Soulsby & Whitehouse (extrapolated: their D* are 0.38 to 1705)"
        in incipient.flume(size, shear_velocity=0.01).sentence
        for size in (1e-5, 2e-3, 0.1)
    ]
    assert told == [True, False, True]
    assert thresholds.observed_fraction(0.92) == pytest.approx(0.5)
    assert thresholds.observed_fraction(0.01) == pytest.approx(0.01)


def test_the_natural_bed_is_that_of_the_stored_runs():
    """Medians at u* d/nu = 10 as on docs/validation/shields.md; between places numbers lie between."""
    bed = thresholds.natural_bed(10.0)
    assert [round(bed.median(p), 4) for p in (0.001, 0.01, 0.05, 0.5)] == [
        0.0098,
        0.0147,
        0.0207,
        0.0435,
    ]
    for p in (0.001, 0.01, 0.05, 0.5):
        assert bed.fraction_of_time(bed.median(p)) == pytest.approx(p)
    assert bed.fraction_of_time(1e-4) == pytest.approx(0.001) and bed.fraction_of_time(
        1.0
    ) == pytest.approx(0.5)
    assert bed.fraction_of_grains(bed.median(0.01), 0.01) == pytest.approx(0.5)
    assert thresholds.natural_bed(60.0).median(0.01) == pytest.approx(0.01451, rel=1e-3)  # by hand
    assert thresholds.natural_bed(0.0).median(0.5) == pytest.approx(0.0845, rel=1e-3)
    assert thresholds.natural_bed(301.0) is None
    answer = incipient.flume(10e-3, depth=0.3, velocity=1.0)
    assert answer.natural_bed is None and answer.as_dict()["entrainment_probability"] is None
    assert "beyond the computed range, 0 to 300" in answer.text()


@pytest.mark.parametrize(
    ("options", "words", "said"),
    [
        # The answer follows the observed beds.
        ({"shear_velocity": 0.01}, "the bed stays at rest", True),
        ({"shear_velocity": 0.0256}, "probably stays", True),
        ({"shear_velocity": 0.036}, "near its threshold", True),
        ({"shear_velocity": 0.05}, "probably moves", True),
        ({"shear_velocity": 0.07}, "the bed moves", True),
        ({"shear_velocity": 1e-5}, "Shields number  3.08e-09\n", True),
        (
            {"shear_velocity": 0.1},
            "entrained more than 50% of the time (within the standard error: more than 50%)",
            True,
        ),
        # sin(32 - 5.71 degrees)/sin(32 degrees) = 0.836
        (
            {"depth": 0.01, "slope": 0.1},
            "critical Shields numbers are about 0.84 times those above",
            True,
        ),
        ({"depth": 0.3, "slope": 0.01}, "times those above", False),
    ],
)
def test_weak_and_strong_flows_in_words(options, words, said):
    assert (words in incipient.flume(2e-3, **options).text()) is said


def test_a_bed_on_a_slope_is_as_near_its_threshold_as_a_level_one_in_a_stronger_flow():
    """With sin(32 - 16.70 degrees)/sin(32 degrees) = 0.498; from tan(32 degrees) = 0.625 on it slides by itself."""
    lead = {"density": 11340.0}
    steep = incipient.flume(2e-3, depth=2.1e-3, slope=0.3, **lead)
    level = incipient.flume(2e-3, shear_velocity=steep.shear_velocity / math.sqrt(0.498), **lead)
    assert steep.observed == pytest.approx(level.observed, rel=1e-3)
    gold = incipient.flume(2e-3, depth=2.1e-3, slope=0.63, density=19300.0)
    assert gold.observed == pytest.approx(0.99) and "more than 99%" in gold.text()


@pytest.mark.parametrize("shear_velocity", [0.0101, 0.04])
def test_the_scene_has_the_shear_velocity_of_the_flume(shear_velocity):
    """Laminar below the turbulent mean profile for fine sand; by the k-omega SST model for coarse sand."""
    size = 2e-4 if shear_velocity < 0.02 else 2e-3
    answer = incipient.flume(size, shear_velocity=shear_velocity, depth=0.1)
    scene = incipient.scene.loads(flume_scene(answer))
    numbers = Setup(scene).numbers
    assert numbers.shear_reynolds == pytest.approx(answer.shear_reynolds, rel=2e-3)
    assert numbers.shields == pytest.approx(answer.shields, rel=4e-3)
    assert (scene.effects.turbulence is True) == (size == 2e-3)
    assert incipient.make_plan(scene).warnings == ()


def test_the_scene_of_gravel_has_walls_in_the_logarithmic_layer():
    """10 mm in 0.3 m of water at 1 m/s, u* d/nu = 676: with k-omega SST the 3-D flow does not converge."""
    answer = incipient.flume(0.01, depth=0.3, velocity=1.0)
    scene = incipient.scene.loads(flume_scene(answer))
    assert Setup(scene).numbers.shear_reynolds == pytest.approx(676.0, rel=2e-3)
    assert scene.turbulence.model == "k-epsilon"
    assert not any(
        "as wide as its cells" in warning for warning in incipient.make_plan(scene).warnings
    )


def test_a_scene_that_its_plan_warns_of_is_written_with_the_warning(tmp_path, said_by):
    """u* d/nu = 0.12 * 2e-3/1.004e-6 = 239, above 200."""
    line = [
        "flume",
        "--diameter",
        "2mm",
        "--shear-velocity",
        "0.12",
        "--scene",
        tmp_path / "x.toml",
    ]
    (warning,) = re.findall("warning: .*", said_by(*line))
    assert "u* d/nu = 239, and above 200 a steady 3-D flow" in warning


def test_gusts_of_a_flume_know_its_depth():
    """u'/u* = 1.8 exp(-0.88 d/h) at a large u* d/nu (Zanke 2003): 0.645 times as strong at h = 2 d as in deep flow."""

    def intensity(depth: float | None) -> float:
        answer = incipient.flume(0.02, shear_velocity=0.1, depth=depth)
        scene = incipient.scene.loads(flume_scene(answer))
        return MeanFlow(Setup(scene), scene.gusts).intensity(1.0)

    assert intensity(0.04) / intensity(None) == pytest.approx(math.exp(-0.44), rel=1e-3)


def test_a_scene_that_entrainment_refuses_has_no_gusts():
    """Over a log-law profile no threshold is computed."""
    answer = incipient.flume(2e-4, shear_velocity=0.0101, depth=0.1)
    assert incipient.scene.loads(flume_scene(answer)).gusts is None


def test_the_command_prints_json_and_writes_scene_and_picture(tmp_path, said_by):
    scene, curve = tmp_path / "quartz.toml", tmp_path / "shields.png"
    line = ["flume", "--diameter", "0.2mm", "--depth", "10cm", "--slope", "0.0001"]
    stored = json.loads(said_by(*line, "--json", "--scene", scene, "--curve", curve))
    assert stored["shear_velocity"] == pytest.approx(math.sqrt(9.81 * 0.1 * 1e-4))
    assert tomllib.loads(scene.read_text())["units"]["diameter"] == pytest.approx(2e-4)
    assert curve.read_bytes().startswith(b"\x89PNG")
    assert "already exists" in said_by(*line, "--scene", scene, code=2)


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({}, "flow"),
        ({"depth": 1.0}, "flow"),
        ({"velocity": 1.0}, "flow"),
        ({"shear_velocity": 0.1, "slope": 0.1}, "flow"),
        ({"shear_velocity": -0.1}, "shear_velocity"),
        ({"shear_velocity": 0.1, "gravity": math.nan}, "gravity"),
        ({"shear_velocity": 0.1, "fluid_density": 1.2}, "viscosity"),
        ({"shear_velocity": 0.1, "density": 990.0}, "density"),
        ({"shear_velocity": 0.1, "temperature": -3.0}, "temperature"),
        ({"depth": 0.001, "velocity": 0.5}, "depth"),
        ({"depth": 0.3, "velocity": 1e5}, "velocity"),
        ({"depth": 0.3, "velocity": 1e-12}, "velocity"),
    ],
)
def test_wrong_numbers_are_refused_by_name(options, key):
    with pytest.raises(SceneError, match=f"^{key}: .*; give|^{key}: .* give"):
        incipient.flume(2e-3, **options)


@pytest.mark.parametrize(
    ("diameter", "shear_velocity", "words"),
    [
        ("2inch", "0.1", '"2inch" is not a length; give a number and one of um, mm, cm, m'),
        ("-2mm", "0.1", "--diameter: is -0.002; give 1e-06 to 10"),
        ("2mm", "-0.1", "--shear-velocity: is -0.1; give 1e-06 to 100"),
    ],
)
def test_wrong_options_are_refused_by_name(diameter, shear_velocity, words, said_by):
    line = ["flume", "--diameter", diameter, "--shear-velocity", shear_velocity]
    assert words in said_by(*line, code=2)
