"""Critical flows and the probability of entrainment, by whole runs."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from PIL import Image
from scenes import POCKET, history_of, on_bed
from test_released import POCKET as POCKET_OF_RELEASED

import incipient
import incipient.sweep
from incipient.accuracy.coarse_runs import farther
from incipient.contact.safety import safety_factor
from incipient.output.searches import write
from incipient.pictures import searches
from incipient.pictures.record import parsed_json
from incipient.results.kinds import THRESHOLD
from incipient.scene import dumps, loads
from incipient.simulation.build import prepared
from incipient.simulation.loads import load_of
from incipient.simulation.steady import loads_at
from incipient.sweep.table import rows
from incipient.thresholds.critical import find_threshold
from incipient.thresholds.outcome import Threshold

# The critical flow against runs of the scene a little below and above it; its error bars against what changes.


COARSE_POCKET = (*POCKET, "numerics.mesh_size=2.0")
SMALL = ("domain.length=12.0", "domain.height=6.0", "body.x=4.0")
ALONE = "numerics.error_bars=false"
STOKES = (*COARSE_POCKET, "fluid.inertia=false")
# Threshold of the pocket, not corrected, in the middle of 160 x 100 with the default cells: 2.94331, 2.94733, 2.94935,
# 2.95036 and 2.95086 with gaps of 0.002, 0.001, ... 0.000125, 2.9514 without; larger domains add 0.0015 (108 x 67.5:
# 2.94209, 240 x 150: 2.94403 with the gap of 0.002).
CONVERGED = 2.953
WEDGE = """
[domain]
length = 12.0
height = 6.0
[fluid]
reynolds = 4.0
scale = "grain"
[flow]
kind = "shear"
[body]
shape = "polygon"
vertices = [[0.0, 0.0], [4.0, 0.0], [4.0, 0.6]]
x = 6.0
density = 2.65
[bed]
kind = "flat"
[gravity]
acceleration = 10.0
[contact]
friction = 5.0
[numerics]
mesh_size = 5.0
error_bars = false
"""


def threshold_of(scene: incipient.Scene) -> Threshold:
    return find_threshold(scene, MPI.COMM_SELF)


def margin(scene: incipient.Scene, factor: float) -> float:
    """The safety factor by a run of the scene with its flow so many times as fast, at the same viscosity."""
    rate = factor * scene.flow.rate
    reynolds = factor * scene.fluid.reynolds
    inertia = f"effects.inertia={'true' if scene.fluid.inertia else 'false'}"
    faster = [f"flow.rate={rate!r}", f"fluid.reynolds={reynolds!r}", inertia, ALONE]
    verdict = incipient.run(loads(dumps(scene), overrides=faster), comm=MPI.COMM_SELF).verdict
    return np.inf if verdict["safety_factor"] is None else verdict["safety_factor"]


@pytest.fixture(scope="module")
def in_pocket() -> Threshold:
    return threshold_of(on_bed(*COARSE_POCKET, *SMALL, ALONE))


def test_inertial_threshold_is_where_the_safety_factor_is_one(in_pocket: Threshold) -> None:
    assert margin(on_bed(*COARSE_POCKET, *SMALL), in_pocket.factor) == pytest.approx(1.0, abs=2e-5)
    assert in_pocket.mode == "pivoting"
    assert 2 <= len(in_pocket.trials) <= 5


def test_stokes_threshold_needs_one_flow() -> None:
    threshold = threshold_of(on_bed(*STOKES, ALONE))
    assert len(threshold.trials) == 1
    assert margin(on_bed(*STOKES), threshold.factor) == pytest.approx(1.0, abs=1e-6)
    # Shields number of a shear flow: nu G / ((s - 1) g d) with nu = G d^2/Re, here G and d are one.
    assert threshold.shields == pytest.approx(threshold.factor / 20.0 / (1.65 * 10.0), rel=1e-9)


def test_contact_forces_balance_the_critical_load(in_pocket: Threshold) -> None:
    """Forces sum to zero, and so do their moments about the centre of mass."""
    load, forces = in_pocket.load, in_pocket.contact_forces
    arms = in_pocket.contacts.points - load.centre
    assert np.allclose(forces.sum(axis=0) + load.flow_force + load.weight, 0.0, atol=1e-6 * 13)
    assert np.allclose(np.cross(arms, forces).sum(axis=0) + load.flow_couple, 0.0, atol=1e-6 * 13)


def on_slope(degrees: float) -> Threshold:
    """Of a block that can only slide, in creeping flow along an inclined bed."""
    block = 'body={shape="rectangle", width=1.2, height=0.4, x=8.0, density=2.65}'
    bed = ("bed.kind=inclined", f"bed.slope={degrees}", "contact.friction=0.5")
    coarse = ("domain.length=16.0", "domain.height=6.0", "numerics.mesh_size=3.0", ALONE)
    return threshold_of(on_bed(block, *bed, *coarse, "fluid.inertia=false"))


def test_critical_flow_on_slopes() -> None:
    """Relative to the level bed cos(b) (1 - tan(b)/tan(phi)), on slopes down and up the flow.

    Beyond phi = 26.57 degrees the weight alone moves the grain, and no flow is needed to say how.
    """
    level = on_slope(0.0)
    for degrees in (20.0, -20.0):
        slope = np.radians(degrees)
        expected = np.cos(slope) * (1.0 - np.tan(slope) / 0.5)
        assert on_slope(degrees).shields / level.shields == pytest.approx(expected, rel=1e-6)
    for degrees in (27.0, -27.0):
        steep = on_slope(degrees)
        assert (steep.factor, steep.mode) == (0.0, "sliding")
        assert not steep.load.flow_force.any()


def shields(shift: float = 0.0, spacing: float = 1.2, *overrides: str) -> float:
    """Critical Shields number of the grain in a pocket; grain and bed are shifted along the channel together."""
    x = 16.0 + shift
    places = (f"body.x={x}", f"bed.spacing={spacing}", f"bed.offset={x - spacing / 2}")
    return threshold_of(
        on_bed(*COARSE_POCKET, "numerics.order=2", ALONE, *places, *overrides)
    ).shields


@pytest.mark.parametrize(
    ("spacings", "more", "degree", "bound"),
    [
        ([1.0, 1.12, 1.25, 1.37, 1.5], ("numerics.mesh_size=3.0", "fluid.inertia=false"), 2, 0.01),
        pytest.param(np.linspace(1.0, 1.6, 25), (), 4, 0.003, marks=pytest.mark.slow),
    ],
    ids=["few", "many"],
)
def test_shields_against_spacing_has_no_jumps(
    spacings: Sequence[float], more: tuple[str, ...], degree: int, bound: float
) -> None:
    """The wider the pocket the safer the grain; a polynomial fits the logarithm."""
    result = np.log([shields(0.0, spacing, *more) for spacing in spacings])
    assert (np.diff(result) > (0.0 if len(spacings) > 5 else 0.05)).all()
    fit = np.polyval(np.polyfit(spacings, result, degree), spacings)
    assert np.abs(fit - result).max() < bound


CHANNELS = {
    "Stokes": ("fluid.inertia=false",),
    "shear": (),
    "open-channel": ("flow={kind='open-channel', velocity=3.0}", "fluid.reynolds=60"),
    "mean": ('flow.datum="mean"',),
}


SPACING = tuple(np.linspace(0.0, 1.2, 7).tolist())


@pytest.mark.parametrize(
    ("flow", "shifts", "bound"),
    [
        ("Stokes", (0.0, 0.3, 0.8), 0.01),
        pytest.param("shear", SPACING, 0.02, marks=pytest.mark.slow),
        pytest.param("open-channel", SPACING, 0.02, marks=pytest.mark.slow),
        pytest.param("mean", SPACING, 0.025, marks=pytest.mark.slow),
    ],
    ids=["Stokes", "shear", "open-channel", "mean"],
)
def test_where_the_inflow_cuts_the_bed_does_not_matter(
    flow: str, shifts: tuple[float, ...], bound: float
) -> None:
    """Most of it is the distance to the inflow, which on a flat bed matters more."""
    cells = f"numerics.mesh_size={3.0 if flow == 'Stokes' else 1.5}"
    result = [shields(shift, 1.2, cells, *CHANNELS[flow]) for shift in shifts]
    assert np.ptp(result) < bound * min(result)


def test_a_grain_held_without_limit_in_its_own_flow() -> None:
    """In a hundred times the flow lift presses the wedge down and holds it; it moves in slower flows, which count."""
    slow = loads(WEDGE, overrides=["flow.rate=1.0"])
    fast = loads(WEDGE, overrides=["flow.rate=100.0", "fluid.reynolds=400.0"])
    assert margin(fast, 1.0) == np.inf and margin(fast, 0.5) < 1.0
    result = [threshold_of(scene) for scene in (slow, fast)]
    assert result[0].factor == pytest.approx(100.0 * result[1].factor, rel=1e-6)
    below, above = (margin(slow, sides * result[0].factor) for sides in (0.99, 1.01))
    assert below > 1.0 > above


# Order two and large cells: what the search finds is compared with the same flow, not with the true one.
COARSE_300 = ("fluid.reynolds=300.0", "numerics.mesh_size=3.0", "numerics.order=2")


def test_a_threshold_at_a_high_reynolds_number() -> None:
    """Where a run from rest may find no steady flow: checked by going up in small steps."""
    scene = on_bed(*COARSE_POCKET, *SMALL, ALONE, *COARSE_300)
    critical = threshold_of(scene).factor
    assert 2.0 < critical < 5.0
    result, before = [], 0.0
    with prepared(scene, MPI.COMM_SELF) as run:
        for factor in critical * np.array([0.25, 0.5, 0.99, 1.01]):  # each from the one before
            load = load_of(scene, loads_at(run, factor, before))
            result.append(safety_factor(load, run.contacts, scene.contact.friction).value)
            before = factor
    assert result[-2] > 1.0 > result[-1]


@pytest.mark.slow
def test_the_smallest_disc_of_the_stability_curve_at_its_largest_reynolds_number() -> None:
    """The flows up to 8.12 times the scene's give 8.3; that flow is found from one of its own order, not of two."""
    result = threshold_of(
        on_bed(*COARSE_POCKET, *SMALL, ALONE, "body.diameter=0.6", "fluid.reynolds=200")
    )
    assert result.is_critical and not result.unsolved
    assert result.factor == pytest.approx(8.3, rel=0.01)
    assert result.trials[-1].safety_factor == pytest.approx(1.0, abs=3e-3)


WEDGED = "contact.friction=5.0"  # the disc in its pocket, whatever the load


def test_without_inertia_none_is_proved() -> None:
    threshold = threshold_of(on_bed(*STOKES, ALONE, WEDGED))
    assert threshold.factor == threshold.held_to == np.inf
    assert "no strength of this flow moves the grain" in threshold.text()


@pytest.mark.slow
def test_error_bars_cover_what_changes(tmp_path: Path) -> None:
    """A finer mesh, a gap nearly closed and a larger domain change the threshold as much as the terms say."""
    kept: list[Threshold] = []
    coarse = find_threshold(
        on_bed(*STOKES, "numerics.correction=false"), MPI.COMM_SELF, keep=kept.append
    )
    assert kept[0].factor == coarse.factor and "was stopped" in kept[0].text()
    assert coarse.bars is not None and set(coarse.bars.terms) == {"discretisation", "gap", "domain"}
    plain = (*POCKET, "fluid.inertia=false", ALONE)
    others = {
        "discretisation": on_bed(*plain, "numerics.mesh_size=1.0", "numerics.order=3"),
        "gap": on_bed(*plain, "numerics.mesh_size=2.0", "contact.gap=0.000625"),
        "domain": farther(farther(on_bed(*plain, "numerics.mesh_size=2.0"))),
    }
    better = {name: threshold_of(scene) for name, scene in others.items()}
    changes = {name: abs(one.factor - coarse.factor) for name, one in better.items()}
    for name, change in changes.items():
        assert change < 3.0 * coarse.bars.terms[name], name
    assert (
        coarse.bars.terms["gap"] < 3.0 * changes["gap"]
        and coarse.bars.terms["domain"] < 3.0 * changes["domain"]
    )
    # Errors of force and torque may cancel in the threshold, which the term does not count on: they are compared.
    term = next(term for term in coarse.bars.loads.terms if term.name == "discretisation")
    fine = load_per_flow(better["discretisation"]) * coarse.factor
    changed = np.abs(fine - load_per_flow(coarse) * coarse.factor).sum()
    assert changed / 3.0 < np.concatenate([term.force, term.torque]).sum() < 3.0 * changed
    assert coarse.bars.low < coarse.factor < coarse.bars.high
    write(THRESHOLD, tmp_path, on_bed(*STOKES), coarse.to_dict())
    assert_told(coarse, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("datum", ["auto", "crest", "mean"])
def test_error_bars_cover_the_datum(datum: str) -> None:
    """By the effective height of the bed it goes to CONVERGED, where others go slowly (docs/contribute/defaults.md)."""
    far = ("domain.length=32.0", "domain.height=20.0", "contact.gap=0.002", f"flow.datum={datum}")
    result = threshold_of(on_bed(*COARSE_POCKET, *far))
    bars, off = result.bars, abs(result.factor - CONVERGED)
    assert bars is not None and bars.low < CONVERGED < bars.high
    assert (off < 0.03) if datum == "auto" else (bars.terms["datum"] > 0.5 * off > 0.04)


def load_per_flow(threshold: Threshold) -> np.ndarray:
    """Force and torque (6,) of the flow of the scene, which are linear in its strength without inertia."""
    load = threshold.load
    return np.concatenate([load.flow_force, load.flow_couple]) / threshold.factor


def assert_told(threshold: Threshold, directory: Path) -> None:
    """With its errors, in words and in threshold.json."""
    bars, stored = threshold.bars, parsed_json(directory / "threshold.json")
    assert stored["error_bars"]["factor"]["terms"] == pytest.approx(bars.terms)
    low, high = (end / threshold.factor * threshold.shields for end in (bars.low, bars.high))
    assert stored["ranges"]["shields"] == pytest.approx([low, high])
    assert {term["name"] for term in stored["error_bars"]["load"]["terms"]} == set(bars.terms)
    text = threshold.text()
    assert len(re.findall(r"\d to \d", text)) == 4 and " +- " not in text
    assert (
        "largest diameter of the grain" in text
        and "in steady laminar shear flow over one grain in 2-D" in text
    )


def test_accuracy_is_honoured() -> None:
    """The error of the critical flow asked for, against a mesh that is much finer."""
    asked = threshold_of(on_bed(*POCKET, *SMALL, ALONE, "numerics.accuracy=0.0001"))
    assert asked.adaptation is not None and asked.adaptation.met
    assert asked.adaptation.of == "critical flow" and len(asked.adaptation.trials) > 1
    fine = threshold_of(on_bed(*COARSE_POCKET, *SMALL, ALONE, "numerics.order=3"))
    assert abs(asked.factor / fine.factor - 1.0) < 0.001
    assert "error of the critical flow" in asked.text()


# `incipient entrainment`: what it writes and says, on two ranks as on one, and what it refuses.


# A disc that settles between half-discs, on large cells, with pictures.
SCENE = (
    POCKET_OF_RELEASED.format(gravity=10.0)
    .replace("x = 3.5\ndensity = 1.5", "x = 3.5\nsettle = true\ndensity = 2.65")
    .replace("error_bars = false", "mesh_size = 3.0")
    .replace("fields = false", "pictures = true")
)
LOGNORMAL = SCENE + "[gusts]\nintensity = 0.3\nmicroscale = 1.0\nintegral_time = 4.0\n"
# Weakest gusts like those of a disc in its pocket; a steady flow of 2.4 moves this one.
GUSTS = {
    "static": 2.4,
    "points": [
        {"duration": 0.5, "strength": 6.87, "error": 0.2},
        {"duration": 4.0, "strength": 2.58, "error": 0.1},
    ],
}


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "scene.toml").write_text(LOGNORMAL)
    (tmp_path / "gusts").mkdir()
    (tmp_path / "gusts" / "gusts.json").write_text(json.dumps(GUSTS))
    (tmp_path / "flume.csv").write_text("shields,probability\n0.003,0.01\n0.005,0.1\n")
    (tmp_path / "percent.csv").write_text("shields,percent\n0.003,50\n")
    return tmp_path / "scene.toml"


@pytest.mark.slow
def test_what_is_found_is_said_written_drawn_and_reported(command, scene: Path) -> None:
    options = ("--gusts", "gusts", "--data", "flume.csv", "--strengths", "0.5", "1", "2")
    done = command("entrainment", scene, "--out", "out", *options)
    for said in (
        "steady flow         moves the grain",
        "of them long enough",
        "Rice 1945",
    ):
        assert said in done.stdout
    out = scene.parent / "out"
    stored = json.loads((out / "entrainment.json").read_text())
    assert [one["probability"] for one in stored["quantiles"]] == [0.001, 0.01, 0.05, 0.5]
    assert stored["data"] == [[0.003, 0.01], [0.005, 0.1]]
    table = history_of(out, "entrainment.csv")
    assert table["strength"].tolist() == [0.5, 1.0, 2.0]
    # Gusts that last long enough are fewer than those that are strong enough for an instant.
    last = table[-1]
    assert 0.0 < last["lasting"] < last["rate"]
    assert last["lasting_low"] <= last["lasting"] <= last["lasting_high"]
    with Image.open(out / "entrainment.png") as image:
        assert image.format == "PNG"
    (axes,) = searches.entrainment(stored, out).axes
    drawn = axes.lines[0].get_xydata()
    assert drawn == pytest.approx(
        np.array([[p["shields"], p["probability"]] for p in stored["curve"]])
    )
    assert any(line.get_xydata().tolist() == stored["data"] for line in axes.lines)
    page = incipient.report(out).read_text()
    assert "instantaneous probability" in page and "threshold of steady flow" in page


@pytest.mark.slow
def test_two_ranks_find_the_same(command, scene: Path) -> None:
    numbers = []
    for ranks in (1, 2):
        out = scene.parent / f"ranks_{ranks}"
        options = ("--set", "output.pictures=false", "--set", "numerics.error_bars=false")
        command("entrainment", scene, "--out", out, *options, ranks=ranks)
        stored = json.loads((out / "entrainment.json").read_text())
        numbers.append([one["shields"] for one in stored["quantiles"]])
        assert all(one["error"] is None for one in stored["quantiles"])
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-3)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--set", "gusts.intensity=-1"), "gusts.intensity"),
        (("--probabilities", "2"), "probabilities: give one or more, each between 0 and 1"),
        (("--strengths", "0"), "strengths: give numbers from 1e-06 to 1e+06"),
        (
            ("--data", "percent.csv"),
            "percent.csv has the Shields number 0.003 with the probability 50",
        ),
        (
            ("--gusts", "nowhere"),
            "--gusts: nowhere/gusts.json cannot be read (No such file or directory); give the directory",
        ),
        (("--data", "nowhere.csv"), "nowhere.csv cannot be read"),
        (("--set", 'gusts.intensity="model"'), 'gusts.intensity: "model" needs a turbulence model'),
        (("--set", "flow.kind=still"), "flow"),
    ],
)
def test_bad_input_is_one_line(
    said_by, monkeypatch, scene: Path, options: tuple[str, ...], said: str
) -> None:
    monkeypatch.chdir(scene.parent)
    (line,) = said_by("entrainment", scene, "--out", "out", *options, code=2).splitlines()
    assert said in line


@pytest.mark.slow
def test_a_sweep_of_intensities(tmp_path: Path) -> None:
    coarse = loads(SCENE + "[gusts]\nintensity = 0.3\n")
    path = tmp_path / "sweep.sqlite"
    incipient.sweep.run(coarse, path, {"gusts.intensity": [0.1, 0.3]}, do="entrainment", jobs=1)
    weak, strong = rows(path)
    assert (weak["gusts.intensity"], strong["gusts.intensity"]) == (0.1, 0.3)
    assert weak["shields"] == pytest.approx(strong["shields"], rel=1e-9)
    assert weak["probability"] < strong["probability"] and "rate" not in weak
    # Levels of lognormal factors, exp(z s - s^2/2): 1.2549 at intensity 0.1 and 1.8962 at 0.3, exceeded with 1%.
    ratio = weak["shields_at_0.01"] / strong["shields_at_0.01"]
    assert ratio == pytest.approx(1.8962 / 1.2549, rel=1e-3)
    assert weak["shields_at_0.01_low"] < weak["shields_at_0.01"] < weak["shields_at_0.01_high"]
