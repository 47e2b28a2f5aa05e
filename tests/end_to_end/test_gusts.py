"""Gusts in time, and the weakest that move a grain."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scenes import history_of, message
from test_released import POCKET

import incipient
from incipient.accuracy.coarse_runs import longest_step
from incipient.errors import OutputError
from incipient.geometry.placement import Placement
from incipient.geometry.plane.grains import Disc, Ellipse
from incipient.output.searches import GustCurve, write
from incipient.parallel import world
from incipient.pictures import searches
from incipient.pictures.directory_pictures import draw
from incipient.planning.plan import make_plan
from incipient.results.kinds import GUSTS
from incipient.scene import Scene, loads
from incipient.setup.driving_force import DisplacedFluid
from incipient.setup.setup import Setup
from incipient.sweep.table import rows
from incipient.thresholds import gusts
from incipient.thresholds.gusts import WITHIN, CriticalGust, GustSearch

# Flows that a gust multiplies in time: they are what they are to be, and act on grains as accelerated fluid does.


CHANNEL = """
[domain]
length = {length}
height = {length}
top = "{top}"
[fluid]
reynolds = {reynolds}
scale = "{scale}"
[flow]
kind = "{kind}"
gust = {{{gust}}}
[time]
end = {end}
step = {step}
start = "stokes"
[numerics]
error_bars = false
mesh_size = 2
[output]
fields = false
"""
DISC = """
[body]
shape = "disc"
diameter = 1.0
centre = [{middle}, {middle}]
"""
TOP_HAT = "start = 0.1, duration = 0.2, strength = 3.0"


def channel(**given: object) -> str:
    """A channel as long as it is high, as text."""
    asked = {
        "length": 4.0,
        "top": "auto",
        "reynolds": 20,
        "scale": "flow",
        "kind": "uniform",
        "gust": TOP_HAT,
    }
    return CHANNEL.format(**{**asked, "end": 0.4, "step": 0.02, **given})


@pytest.mark.parametrize("kind", ["shear", "poiseuille", "uniform", "open-channel"])
def test_a_flow_without_a_grain_is_the_factor_times_itself(kind: str) -> None:
    """Whatever the size of the domain: f(t) U(y) is the flow."""
    places = np.array([[1.0, 1.0], [2.0, 2.5], [3.5, 0.3]])
    for end, factor in ((0.2, 3.0), (0.4, 1.0)):
        scene = loads(channel(kind=kind, end=end))
        computed = np.array([one.velocity for one in incipient.run(scene).at(places)])
        plain = Setup(scene).base_flow.velocity(np.vstack([places.T, np.zeros(3)]), 0.0).T
        assert np.abs(computed - factor * plain).max() < 2e-4 * np.abs(plain).max()


@pytest.mark.parametrize(
    "shape",
    ["duration = 0.4, strength = 3.0", 'shape = "points", points = [[0, 1], [0.2, 3], [0.4, 1]]'],
)
def test_adaptive_steps_do_not_step_over_a_gust(shape: str, tmp_path: Path) -> None:
    """In the steady flow before it steps grow to several times its duration; its largest factor is 3."""
    text = channel(kind="shear", gust=f"start = 5.0, {shape}", end=8.0, step=0.05)
    incipient.run(loads(text.replace("step = 0.05", "step = 0.05\ntolerance = 0.01")), tmp_path)
    history = history_of(tmp_path)
    assert history["step"].max() > 0.4
    assert history["gust"].max() == pytest.approx(3.0)


def test_a_grain_as_dense_as_the_fluid_goes_with_a_uniform_flow(tmp_path: Path) -> None:
    """Exact: what accelerates the fluid accelerates the fluid displaced, and the grain in its place."""
    disc = DISC.format(middle=2.0) + 'motion = "free"\ndensity = 1.0\nvelocity = [1.0, 0.0]\n'
    incipient.run(
        loads(channel(top="stream", scale="grain", gust="duration = 0.2, strength = 3.0") + disc),
        tmp_path,
    )
    computed = history_of(tmp_path)
    assert computed["gust"].max() == 3.0
    assert computed["velocity_x"] == pytest.approx(computed["gust"], rel=1e-5)
    assert (
        np.abs(computed["step"] - 0.02).max() < 1e-12
    )  # round-off of the spin, which is zero, halves no step


def test_the_force_on_the_fluid_displaced_is_that_of_its_mean_velocity() -> None:
    """In a shear that rises by one in unit time: area times the velocity at the centroid, couple -I_yy, exactly.

    The disc's I_yy is pi d^4/64; points half a cell of 1/48 apart leave less than 1% of it.
    """
    scene = loads(
        channel(kind="shear", gust="duration = 0.2, strength = 3.0") + DISC.format(middle=2.0)
    )
    setup = Setup(scene)
    force, couple = DisplacedFluid(Disc(1.0), setup.base_flow).load(Placement((2.0, 2.0)))
    rate = float(setup.base_flow.velocity(np.array([[2.0], [1.0]]), 0.0)[0, 0])
    assert force == pytest.approx([math.pi / 4.0 * 2.0 * rate, 0.0, 0.0], rel=1e-9)
    assert couple == pytest.approx([0.0, 0.0, -math.pi / 64.0 * rate], rel=1e-2)
    off = DisplacedFluid(Ellipse((0.5, 0.02)), setup.base_flow).load(
        Placement((2.0, 2.0), 0.5 * math.pi)
    )
    assert off[1, 2] == pytest.approx(-math.pi / 4.0 * 0.02 * 0.5**3 * rate, rel=1e-2)


@pytest.mark.parametrize(("shape", "area"), [("top-hat", 2.0), ("cosine", 1.0)])
def test_a_gust_lasts_as_long_as_it_is_to(shape: str, area: float) -> None:
    """The integral of what a top-hat and half a cosine wave add to the factor."""
    times = np.linspace(0.0, 10.0, 20001)
    gust = f'shape = "{shape}", start = 1.5, duration = 1.0, strength = 3.0'
    flow: Any = loads(channel(gust=gust)).flow
    added = np.array([flow.gust.factor(t) - 1.0 for t in times])
    assert added.mean() * 10.0 == pytest.approx(area, rel=1e-3)
    assert added[times < 1.5].max() == 0.0 and added[-1] == 0.0


def test_a_course_may_stand_in_a_file(tmp_path: Path) -> None:
    (tmp_path / "gust.csv").write_text("time,factor\n0,1\n0.1,2.5\n0.3,1\n")
    (tmp_path / "scene.toml").write_text(
        channel(gust='shape = "points", file = "gust.csv", start = 0.5')
    )
    flow = incipient.load(tmp_path / "scene.toml").flow
    assert [flow.gust.factor(t) for t in (0.0, 0.55, 0.6, 0.7, 5.0)] == pytest.approx(
        [1.0, 1.75, 2.5, 1.75, 1.0]
    )  # type: ignore[union-attr]


def warned(text: str) -> list[str]:
    return [one for one in make_plan(loads(text)).warnings if "no step sees that" in one]


@pytest.mark.parametrize(
    ("step", "gust", "unseen"),
    [
        (0.02, 'shape = "points", points = [[0, 1], [0.005, 3], [0.01, 1]]', ["100%"]),
        (0.08, 'shape = "points", points = [[0, 1], [0.1, 3], [0.2, 1]]', ["20%"]),
        (0.05, 'shape = "points", points = [[0, 1], [0.1, 3], [0.2, 1]]', []),
        (0.08, 'shape = "points", points = [[0, 1], [0.1, 1], [0.101, 3], [0.4, 3]]', []),
        (0.05, 'shape = "points", points = [[-1, 5], [0, 1], [0.2, 3]]', []),
        (0.1, 'shape = "cosine", start = 0.05, duration = 0.2', ["50%"]),
        (0.1, 'shape = "cosine", duration = 0.2', []),
    ],
)
def test_gusts_that_no_step_sees_are_warned_of(step: float, gust: str, unseen: list[str]) -> None:
    """The peak less the larger value at both ends of its step: of a triangle (0.1 - 0.08)/0.1, of a cosine a half."""
    said = warned(channel(step=step, gust=gust))
    assert [one.split("differs by ")[1].split()[0] for one in said] == unseen
    assert not warned(channel(step=step, gust=gust).replace("step =", "tolerance = 0.01\nstep ="))


@pytest.mark.parametrize("steps", ["step =", "tolerance = 0.01\nstep ="])
@pytest.mark.parametrize("end", [0.4, 1.0])
def test_a_gust_after_the_end_is_warned_of(end: float, steps: str) -> None:
    text = channel(step=0.1, end=end, gust="start = 0.5").replace("step =", steps)
    said = make_plan(loads(text)).warnings
    late = [one for one in said if "the gust begins at t = 0.5, after the end of the run" in one]
    assert len(late) == (end < 0.5)


SINE = 'components = ["sin(2*pi*t + pi/8)", "0"]'


@pytest.mark.parametrize(
    ("kind", "flow", "step", "end", "warnings"),
    [
        *(("expression", SINE, step, 7.0, told) for step, told in ((1.0, 1), (0.7, 1), (0.125, 0))),
        # A trough of the layer's cos(pi t/2), at t = 2, may be after the end.
        *(("oscillatory", "period = 4.0", 0.5, end, 0) for end in (1.0, 4.0)),
    ],
)
def test_oscillations_that_no_step_sees_are_warned_of(
    kind: str, flow: str, step: float, end: float, warnings: int
) -> None:
    """Eight steps in a period see its extremes to (1 - cos(pi/8))/2 of their range at any phase, one sees nothing."""
    text = channel(kind=kind, gust="", step=step, end=end).replace("gust = {}", flow)
    start = 'start = "stokes"' if kind == "oscillatory" else ""
    assert len(warned(text.replace(start, ""))) == warnings


FORMULAS = 'components = ["y*(1 + sin(t))", "0"]'


@pytest.mark.parametrize(("kind", "flow"), [("shear", "gust = {}"), ("expression", FORMULAS)])
def test_plans_of_a_billion_steps_keep_no_number_of_each(kind: str, flow: str) -> None:
    """Formulas are sampled at a million instants at most."""
    text = channel(kind=kind, gust="", step=1e-9).replace("gust = {}", flow)
    assert make_plan(loads(text)).scheme
    assert longest_step(loads(text)) >= 1e-6


# The weakest gusts that move a grain out of its pocket: searched, written, drawn, reported.


def scene(**changes: dict[str, object]) -> Scene:
    """A released disc in a pocket of half-discs; sections with other keys."""
    plain = loads(POCKET.format(gravity=10.0)).model_dump(exclude_unset=True)
    plain["body"]["motion"] = "released"
    plain["time"] = {"end": 1.0, "step": 0.1, "start": "steady"}
    for section, keys in changes.items():
        plain[section] = {**plain.get(section, {}), **keys}
    return Scene(**plain)


class Sharp(GustSearch):
    """A search whose grain leaves from a known impulse on."""

    def leaves(self, strength: float, duration: float) -> bool:
        self.runs += 1
        return (strength - 1.0) * duration >= 3.0


def test_the_search_brackets_what_it_is_after() -> None:
    """The weakest gust has (strength - 1) duration = 3; a rise of 0.9 in a gust of 2 is one of 0.45 in a gust of 1."""
    search = Sharp(scene(flow={"gust": {"duration": 2.0, "rise": 0.9}}), world())
    gusts = list(search.critical([0.5, 4.0]))
    assert [gust.duration for gust in gusts] == [4.0, 0.5]
    for gust in gusts:
        assert gust.held < 1.0 + 3.0 / gust.duration <= gust.leaves <= (1.0 + WITHIN) * gust.held
        assert gust.to_dict()["impulse"] == pytest.approx(3.0, rel=2 * WITHIN)
    assert sum(gust.runs for gust in gusts) == search.runs - 1
    course = search.in_gust(3.0, 1.0).flow.gust
    assert (course.duration, course.strength, course.rise) == (1.0, 3.0, pytest.approx(0.45))


@pytest.mark.parametrize("finished", [1, 2, 10])
def test_a_search_continues_from_its_finished_runs(
    finished: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As if uninterrupted: each run once, the steady threshold once, the same strengths and counts of runs."""
    calls: list[tuple[float, float, float]] = []
    interrupts = [KeyboardInterrupt]

    def run(search: GustSearch, strength: float, duration: float) -> bool:
        if len(calls) == finished and interrupts:
            raise interrupts.pop()
        calls.append((search.longer, strength, duration))
        return (strength - 1.0) * duration >= 3.0 * search.longer

    def steady(search: GustSearch) -> SimpleNamespace:
        calls.append((0.0, 0.0, 0.0))
        return SimpleNamespace(
            factor=math.inf, sentence="none up to 10 times the flow of the scene"
        )

    monkeypatch.setattr(GustSearch, "_run_until_decided", run)
    monkeypatch.setattr(GustSearch, "steady_threshold", steady)
    gusty = scene(numerics={"error_bars": True})
    with pytest.raises(KeyboardInterrupt):
        incipient.gusts(gusty, [4.0, 1.0], tmp_path / "search")
    curve = incipient.gusts(gusty, [4.0, 1.0], tmp_path / "search")
    assert len(calls) == len(set(calls))
    computed = calls[:]
    calls.clear()
    assert incipient.gusts(gusty, [4.0, 1.0]).to_dict() == curve.to_dict()
    assert sorted(calls) == sorted(computed)
    other = scene(numerics={"error_bars": True}, body={"density": 3.0})
    incipient.gusts(other, [4.0, 1.0], tmp_path / "search")
    assert sorted(calls) == sorted(2 * computed)  # nothing is known of another scene


@pytest.mark.parametrize("coarse", [2.0, 5.02, 9.0])
def test_the_error_is_what_coarser_cells_and_longer_steps_change(
    coarse: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With both brackets; the grain leaves from a strength of 5 on."""

    def leaves(search: GustSearch, strength: float, duration: float) -> bool:
        return strength >= (5.0 if search.longer == 1.0 else coarse)

    monkeypatch.setattr(GustSearch, "leaves", leaves)
    search = GustSearch(scene(numerics={"error_bars": True}), world())
    for gust in search.critical([1.0, 2.0]):
        change = abs(coarse - 5.0)
        assert gust.error is not None
        assert change <= gust.error <= change + WITHIN * (5.0 + coarse)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (
            {"body": {"motion": "fixed"}, "time": None},
            "body.motion: gusts are computed for a grain that rests",
        ),
        ({"bed": {"kind": "flat"}}, "bed.kind: a flat bed has no pocket"),
        (
            {"flow": {"kind": "shear", "gust": {"shape": "points", "points": [[0, 1], [1, 2]]}}},
            'flow.gust.shape: "points" has no duration',
        ),
        (
            {"effects": {"turbulence": True}, "flow": {"kind": "open-channel"}},
            "effects.turbulence: gusts are computed in laminar flow only",
        ),
        (
            {"numerics": {"accuracy": 0.01}},
            "numerics.accuracy: gusts are searched to 2%; leave it out",
        ),
    ],
)
def test_scenes_without_a_pocket_or_gusts_are_refused(changes: dict[str, Any], says: str) -> None:
    plain = scene().model_dump(exclude_unset=True)
    if "body" in changes:
        changes = {**changes, "body": {**plain["body"], **changes["body"]}}
    assert says in message(lambda: GustSearch(Scene(**{**plain, **changes}), world()))


def test_keys_of_motion_leave_the_steady_threshold_as_it_is() -> None:
    """The critical steady flow of a gust search is that of `incipient threshold` for the same grain at rest."""
    coarse: dict[str, Any] = {"error_bars": False, "mesh_size": 3.0}
    in_time = {"convection": "extrapolated", "interface_tolerance": 1e-4, "remesh_below": 0.3}
    search = GustSearch(
        scene(
            numerics={**coarse, **in_time},
            output={"every": 1, "checkpoint": 3},
            effects={"unsteadiness": True},
        ),
        world(),
    )
    plain = scene(numerics=coarse).model_dump(exclude_unset=True)
    del plain["time"], plain["body"]["motion"]
    assert search.steady_threshold().factor == pytest.approx(
        incipient.threshold(Scene(**plain)).factor, rel=1e-6
    )


def test_what_is_found_is_drawn_and_reported(tmp_path: Path) -> None:
    points = (
        CriticalGust(4.0, "top-hat", 2.5, 2.55, 0.05, 8),
        CriticalGust(1.0, "top-hat", 4.8, 4.9, None, 7),
    )
    steady = SimpleNamespace(factor=1.6, sentence="1.6 times the flow of the scene")
    curve = GustCurve(scene(), steady, points)
    (tmp_path / "gusts.json").write_text(json.dumps(curve.to_dict()))
    (axes,) = searches.gusts(curve.to_dict(), tmp_path).axes
    durations, strengths = axes.lines[0].get_data()
    assert durations.tolist() == [1.0, 4.0]
    assert strengths == pytest.approx([(4.8 * 4.9) ** 0.5, (2.5 * 2.55) ** 0.5])
    assert any(list(line.get_ydata()) == [1.6, 1.6] for line in axes.lines)
    bars = [bar for bar in axes.collections[0].get_segments() if bar.size]
    assert [float(np.ptp(bar[:, 1])) for bar in bars] == pytest.approx([0.1])
    assert any("no bar: error not known" in text.get_text() for text in axes.get_legend().texts)
    with Image.open(draw(tmp_path)[0]) as image:
        assert image.format == "PNG"
    page = incipient.report(tmp_path).read_text()
    assert "1.6 times the flow of the scene" in page and "leaves its pocket at" in page
    assert "gust of 1          strength 4.85 +- not known in 7 runs" in curve.text()


def test_a_curve_without_a_threshold_of_steady_flow_says_why(tmp_path: Path) -> None:
    steady = SimpleNamespace(factor=math.inf, sentence="none up to 10 times the flow of the scene")
    curve = GustCurve(scene(), steady, (CriticalGust(1.0, "top-hat", 14.8, 14.9, 0.1, 7),))
    write(GUSTS, tmp_path, scene(), curve.to_dict())
    stored = json.loads((tmp_path / "gusts.json").read_text())
    labels = [line.get_label() for line in searches.gusts(stored, tmp_path).axes[0].lines]
    assert "threshold of steady flow" not in labels
    page = incipient.report(tmp_path).read_text()
    assert steady.sentence in curve.text() and steady.sentence in page


def test_a_foreign_file_is_refused_before_any_flow_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "gusts.json").write_text("{}")
    monkeypatch.setattr(GustSearch, "steady_threshold", pytest.fail)
    with pytest.raises(OutputError, match=r"gusts\.json: was not written by incipient"):
        incipient.gusts(scene(), [1.0], tmp_path)


def test_a_grain_that_neither_leaves_nor_sinks_back_is_not_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The run lasts from the end of a top-hat at 1.1, LONGEST times the scene's end."""

    def undecided(scene: Scene, *_: object) -> SimpleNamespace:
        ended = {"by": "time", "time": scene.time.end, "nearest": "bed"}
        return SimpleNamespace(trajectory={"ended": ended, "on_bed": {"left_pocket": None}})

    monkeypatch.setattr(gusts, "run_scene", undecided)
    says = message(lambda: GustSearch(scene(), world()).leaves(3.0, 1.0))
    assert says.startswith("time.end: in a gust of 1 and strength 3 the grain neither leaves")
    assert "until t = 17.1;" in says


@pytest.mark.slow
@pytest.mark.parametrize(("strength", "leaves"), [(8.0, False), (11.0, True), (12.0, True)])
def test_a_grain_leaves_where_its_path_passes_the_ridge(strength: float, leaves: bool) -> None:
    """Whatever the end of the scene: its disc flies, at 11 highest before the ridge at x = 3, the next half-disc."""
    small = scene(
        domain={"length": 6.0, "height": 3.0},
        body={"density": 2.0, "x": 2.5},
        flow={"gust": {"start": 0.5}},
        time={"end": 0.3},
        numerics={"mesh_size": 3.0},
    )
    search = GustSearch(small, world())
    assert search.leaves(strength, 0.25) == leaves
    gust = search.in_gust(strength, 0.25)
    time = gust.time.model_copy(update={"until": "end", "end": 2.2})
    result = incipient.run(gust.model_copy(update={"time": time}))
    assert (result.trajectory["place"][0] > 3.0) == leaves


@pytest.mark.slow
def test_a_grain_blown_to_the_end_of_the_domain_does_not_count_as_held() -> None:
    """A gust of 9.5 carries the disc into another pocket, one of 13.3 past all of them."""
    search = GustSearch(scene(body={"density": 2.0}, numerics={"mesh_size": 3.0}), world())
    says = message(lambda: search.leaves(13.3, 0.5))
    assert says.startswith("domain: in a gust of 0.5 and strength 13.3 the grain meets the outflow")


@pytest.mark.slow
def test_a_disc_in_a_pocket_needs_a_stronger_gust_if_it_is_shorter(tmp_path: Path) -> None:
    """Above the steady threshold of the same scene; on default cells 4.87 and 2.59."""
    coarse = scene(numerics={"mesh_size": 1.5}, body={"density": 2.0})
    curve = incipient.gusts(coarse, [1.0, 4.0], tmp_path)
    long, short = (one.strength for one in curve.points)
    assert curve.static.factor < long < short
    assert (long, short) == pytest.approx((2.59, 4.87), rel=0.05)
    assert history_of(tmp_path, "gusts.csv")["duration"].tolist() == [4.0, 1.0]


@cache
def threshold() -> float:
    """How many times faster a steady flow begins to move the disc of density 2, by `incipient threshold`."""
    return GustSearch(scene(body={"density": 2.0}), world()).steady_threshold().factor


@pytest.mark.slow
@pytest.mark.parametrize(("share", "leaves"), [(0.98, False), (1.02, True)])
def test_a_gust_without_end_moves_the_grain_from_its_threshold_on(
    share: float, leaves: bool
) -> None:
    """The strength is a share of the critical flow of the same grain held in a steady flow, 1.601 when written.

    Once it moves, the disc leaves: beside the bed the flow has more of a hold on it. In the plane the film that opens
    below it takes a time of 60, close to the threshold.
    """
    wide = scene(
        body={"density": 2.0},
        flow={"gust": {"duration": 400.0, "rise": 1.0, "strength": share * threshold()}},
        time={"end": 100.0, "step": 0.5, "until": "out-of-pocket"},
    )
    result = incipient.run(wide)
    assert (result.trajectory["ended"]["by"] == "out-of-pocket") == leaves
    assert (result.trajectory["on_bed"]["mode"] == "rest") != leaves


def in_sweep(tmp_path: Path, do: str, over: dict[str, object]) -> list[dict[str, object]]:
    """Rows of a sweep of gusts on a coarse mesh."""
    gusty = scene(
        body={"density": 2.0},
        flow={"gust": {"start": 0.1, "duration": 2.0}},
        time={"end": 4.0, "step": 0.2, "until": "out-of-pocket"},
        numerics={"error_bars": False, "mesh_size": 3.0},
        output={"fields": False},
    )
    incipient.sweep.run(gusty, tmp_path / "sweep.sqlite", over, do=do, jobs=1)
    return rows(tmp_path / "sweep.sqlite")


@pytest.mark.slow
def test_a_sweep_varies_gusts_and_says_which_moved_the_grain_out(tmp_path: Path) -> None:
    """Columns of strength and duration, of when the grain moved and left, and of what ended the runs."""
    weak, strong = in_sweep(
        tmp_path, "run", {"flow.gust.strength": [1.2, 6.0], "flow.gust.duration": [2.0]}
    )
    assert (weak["flow.gust.strength"], strong["flow.gust.strength"]) == (1.2, 6.0)
    assert weak["flow.gust.duration"] == 2.0
    assert weak["ended"] == "in-pocket" and weak["does"] == "rest" and "left_pocket" not in weak
    assert strong["ended"] == "out-of-pocket" and strong["first_motion"] == 0.0  # in the first step
    assert 0.1 < strong["left_pocket"] < 4.0


@pytest.mark.slow
def test_a_sweep_searches_critical_gusts(tmp_path: Path) -> None:
    """A denser grain needs the stronger gust; each strength is bracketed to 2%."""
    light, dense = in_sweep(tmp_path, "gust", {"body.density": [2.0, 2.4]})
    for row in (light, dense):
        assert row["held"] < row["strength"] < row["leaves"] <= (1.0 + WITHIN) * row["held"]
    assert light["strength"] < dense["strength"]
