"""What accuracy costs: fronts, laws, references, words, variants and rows, the resumption of a study.

Runs are made up here, from laws whose constants the fits must find again; tests/end_to_end has real ones.
"""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_runs import COLUMNS, TIMED, Runner, quiet, scene, studied
from scenes import TANK

from incipient.accuracy.first_mesh import counted
from incipient.cost import calibration, frontier, markdown, quantities
from incipient.cost import study as cost
from incipient.cost.command import builtin, chosen, summary
from incipient.cost.ladder import QUICK, RATIO, Spread, ladder, spread
from incipient.cost.ladder import STEADY as STEADY_SPREAD
from incipient.cost.measurement import MeasuredRun, Variant
from incipient.cost.records import known_runs
from incipient.errors import ConvergenceError, OutputError, SceneError
from incipient.scene import Scene, load, loads

DEMOS = Path(__file__).parents[2] / "demos/scenes"
SPACE = DEMOS / "sphere_on_plane.toml"

# -- numbers ------------------------------------------------------------------------------------------------


@given(st.lists(st.tuples(st.floats(1, 100), st.floats(1e-6, 1)), min_size=1, max_size=12))
def test_the_front_is_what_nothing_beats(points: list[tuple[float, float]]) -> None:
    costs, errors = zip(*points, strict=True)
    found = frontier.front(costs, errors)
    for index, (c, e) in enumerate(points):
        beaten = any(a <= c and b <= e and (a, b) != (c, e) for a, b in points)
        assert (index in found) <= (not beaten)
    kept = [points[i] for i in found]
    assert kept == sorted(kept)
    assert {
        p for p in points if not any(a <= p[0] and b <= p[1] and (a, b) != p for a, b in points)
    } == set(kept)


@pytest.mark.parametrize("power", [0.5, 1.5, 4.0])
def test_a_law_is_found_again(power: float) -> None:
    """error = 0.02 (t - 1.3)^-p, exactly."""
    times = 1.3 + np.geomspace(0.1, 10.0, 5)
    law = frontier.fitted(list(times), list(0.02 * (times - 1.3) ** -power), start=1.3)
    assert law is not None
    assert (law.constant, law.power) == pytest.approx((0.02, power), rel=1e-9)
    assert law.time(0.02 * 2.0**-power) == pytest.approx(3.3)
    assert law.digit == pytest.approx(10.0 ** (1.0 / power))
    assert law.scatter == pytest.approx(1.0)


def test_too_little_makes_no_law() -> None:
    assert frontier.fitted([2.0], [0.1], 1.0) is None
    assert frontier.fitted([2.0, 2.0], [0.1, 0.2], 1.0) is None
    assert frontier.fitted([2.0, 3.0], [0.1, 0.2], 1.0) is None, "errors that grow with time"
    assert frontier.fitted([2.0, 3.0], [0.1, 0.09], 1.0) is None, "errors that hardly differ"


def test_a_study_without_a_law_says_what_its_runs_reached(tmp_path: Path) -> None:
    class Exact(Runner):
        def __call__(self, scene: Scene, variant: Variant) -> MeasuredRun:
            run = super().__call__(scene, variant)
            exact = {"force_x": 3.0, "force_y": 4.0, "couple": 0.5, "safety_factor": 1.5}
            return replace(run, found=exact)

    study = studied(tmp_path, Exact(), quick=True)
    assert study.words() == "0%: 1.1 s; too few runs can be told apart from the reference for a law"
    assert not any(one.told_apart for one in study.judged)
    assert "No law" in markdown.page(study)


def test_words_of_a_law() -> None:
    """error = (t - 1)^-2 percent: 1% takes 1 + 1 s, 0.1% 1 + sqrt(10) s, beyond the runs "about"."""
    law = frontier.CostLaw(0.01, 2.0, 1.0)
    said = frontier.words(law, [0.02, 0.002], [1.7, 3.2])
    assert (
        said == "1%: 2 s, 0.1%: about 4.2 s; each further digit x 3.2, beyond the 1 s of starting"
    )
    assert frontier.words(law, [0.005, 0.002], [1.5, 3.2]).startswith("1%: at most 1.5 s")


@pytest.mark.parametrize(
    ("time", "said"),
    [(0.25, "0.25 s"), (42.4, "42 s"), (119.0, "119 s"), (150.0, "2.5 min"), (3e5, "3.5 days")],
)
def test_times_in_words(time: float, said: str) -> None:
    assert frontier.seconds(time) == said


def test_start_is_what_unknowns_do_not_change() -> None:
    """t = 1.2 + 3e-5 n + 1e-6 n s."""
    n, s = np.array([1e3, 4e3, 1e4, 4e4]), np.array([5, 8, 6, 9])
    assert frontier.overhead(1.2 + 3e-5 * n + 1e-6 * n * s, n, s) == pytest.approx(1.2)


def test_richardson() -> None:
    """2 + 3 h^4 at h, h/r, h/r^2; no limit is believed of numbers that go to and fro."""
    line = [{"a": 2.0 + 3.0 * (0.5 / RATIO**i) ** 4, "b": float((-1) ** i)} for i in range(3)]
    found = frontier.reference(line, RATIO, [])
    assert found.values == pytest.approx({"a": 2.0, "b": 1.0})
    assert found.uncertainty["a"] == pytest.approx(line[-1]["a"] - 2.0)
    assert found.uncertainty["b"] == 2.0
    assert frontier.extrapolated([1.0, 1.0, 1.0], RATIO) is None


def test_a_reference_alone_is_doubted_by_what_lies_nearest() -> None:
    found = frontier.reference([{"a": 1.0}], math.nan, [{"a": 1.4}, {"a": 3.0}])
    assert found.uncertainty["a"] == pytest.approx(0.1)


def test_peak_between_samples() -> None:
    t = np.linspace(0.0, 3.0, 30)
    assert quantities.peak(t, 1.0 - (t - 1.234) ** 2) == pytest.approx(1.0)
    assert quantities.peak(t, t) == 3.0


# -- ladders ------------------------------------------------------------------------------------------------


def test_ladder_of_a_steady_scene() -> None:
    steps = ladder(scene("numerics.mesh_size=2.0"), replace(STEADY_SPREAD, solvers=()))
    assert len(steps.variants) == 15
    assert max(variant.mesh_size for variant in steps.variants) == 4.0
    assert steps.reference == Variant(4, 1.0 / RATIO)
    assert steps.ratio == pytest.approx(RATIO)
    quick = ladder(scene(), spread(scene(), quick=True))
    assert (len(quick.variants), quick.reference) == (4, Variant(4, RATIO / 2.0))


def test_ladder_in_time() -> None:
    """Cells and steps are refined together, and each a little behind the other."""
    steps = ladder(scene(TIMED), replace(QUICK, orders=(2,)))
    found = [(variant.mesh_size, variant.step) for variant in steps.variants]
    assert found == [(2.0, 0.04), (pytest.approx(RATIO), 0.04), (pytest.approx(RATIO), 0.02)]
    assert steps.reference == Variant(2, pytest.approx(1.0), 0.01)
    assert Variant(3, 1.0, 0.02).of(scene(TIMED)).time.step == 0.02


def test_ladder_in_space() -> None:
    """Of the scene's own order, the finest run with cells no smaller than the scene's over the square root of two."""
    sphere = load(SPACE)
    steps = ladder(sphere, spread(sphere, quick=False))
    assert [(one.order, one.mesh_size) for one in steps.variants] == [
        (3, 2.0),
        (3, pytest.approx(RATIO)),
        (3, 1.0),
    ]
    assert steps.reference == Variant(4, pytest.approx(1.0 / RATIO))
    assert not steps.compared
    quick = ladder(sphere, spread(sphere, quick=True))
    assert (len(quick.variants), quick.reference) == (2, Variant(4, 1.0))
    assert spread(load(SPACE, ["numerics.order=2"]), quick=True).orders == (2,)


def test_own_ladders() -> None:
    uneven = ladder(scene(), Spread((3,), (2.0, 1.5, 1.0), solvers=()))
    assert [variant.mesh_size for variant in uneven.variants] == [2.0, 1.5, 1.0]
    assert chosen(scene(), True, orders=[4], sizes=None, steps=None).orders == (4,)
    for wrong, said in ((Spread, "--sizes"), (lambda **k: chosen(scene(), True, **k), "--steps")):
        with pytest.raises(SceneError, match=said):
            wrong(sizes=(0.0,)) if said == "--sizes" else wrong(steps=[1.0])
    with pytest.raises(SceneError, match="order 2, 3 or 4"):
        Spread(orders=(5,))
    assert math.isnan(ladder(scene(), Spread((4,), (3.0, 1.5, 1.0))).ratio)


def test_a_rung_changes_nothing_but_how_finely() -> None:
    base = scene(TIMED, "numerics.tolerance=1e-7")
    changed = Variant(3, 1.5, 0.02).of(base)
    assert calibration.digest(changed) == calibration.digest(base)
    assert changed.numerics.tolerance == 1e-7
    assert not changed.numerics.error_bars
    assert calibration.digest(scene("fluid.reynolds=21.0")) != calibration.digest(scene())


# -- a study of runs that are made up -----------------------------------------------------------------------


def test_a_study_finds_errors_and_law(tmp_path: Path) -> None:
    study = studied(tmp_path, Runner())
    assert study.reference.values["force_x"] == pytest.approx(3.0, rel=1e-6), (
        "improved by Richardson"
    )
    first = next(one for one in study.judged if one.run.variant == Variant(2, 2.0))
    assert first.error == pytest.approx(0.02, rel=1e-3)
    assert set(first.errors) == {"force", "couple", "safety factor", "drag", "lift"}
    law = study.laws["cpu"]
    assert law is not None
    assert law.start == pytest.approx(1.0, abs=0.05)
    assert "each further digit" in study.words()
    assert cost.to_dict(study)["reference"]["run"] == study.compared_with.variant.name


def test_a_study_goes_on_where_it_was_interrupted(tmp_path: Path) -> None:
    class Stopped(Runner):
        def __call__(self, scene: Scene, variant: Variant) -> MeasuredRun:
            if len(self.made) == 3:
                raise KeyboardInterrupt
            return super().__call__(scene, variant)

    first, second, third = Stopped(), Runner(), Runner()
    with pytest.raises(KeyboardInterrupt):
        studied(tmp_path, first, quick=True)
    with (tmp_path / "cost.csv").open("a") as rows:
        rows.write("3,1.41421,,,0.1")  # a writer that was killed
    whole = studied(tmp_path, second, quick=True)
    assert (len(first.made), len(second.made)) == (3, 2)
    again = studied(tmp_path, third, quick=True)
    assert not third.made
    assert [one.error for one in again.judged] == [one.error for one in whole.judged]


def test_rows_hold_every_digit_and_awkward_words(tmp_path: Path) -> None:
    runner, failing = Runner(Variant(2, 2.0)), Variant(2, 2.0)
    study = studied(tmp_path, runner, quick=True)
    (failed,) = study.failed
    assert failed.failed == 'no steady flow, "of course", found'
    assert failing.name in summary(study, tmp_path)
    kept = known_runs(COLUMNS, tmp_path)
    assert kept[Variant(3, 2.0).key].found == runner(scene(), Variant(3, 2.0)).found


def test_without_its_reference_the_finest_run_serves(tmp_path: Path) -> None:
    study = studied(tmp_path, Runner(Variant(4, RATIO / 2.0)), quick=True)
    assert study.compared_with.variant == Variant(3, pytest.approx(RATIO, rel=1e-5))
    assert len(study.judged) == 3


def test_too_many_failures_end_the_study(tmp_path: Path) -> None:
    everything = ladder(scene(), spread(scene(), True))
    runner = Runner(*everything.variants, everything.reference)
    with pytest.raises(
        ConvergenceError, match="fewer than two runs of the ladder succeeded: no steady flow"
    ):
        studied(tmp_path, runner, quick=True)


def test_the_directory_of_another_scene_is_refused(tmp_path: Path) -> None:
    studied(tmp_path, Runner(), quick=True)
    other = scene("fluid.reynolds=3.0")
    with pytest.raises(OutputError, match="the runs of another scene"):
        cost.run_ladder(other, ladder(other, QUICK), tmp_path, Runner(), quiet)
    (tmp_path / "cost.csv").write_text("order,mesh_size\n2,x\n")
    with pytest.raises(OutputError, match="delete it to begin anew"):
        studied(tmp_path, Runner(), quick=True)


def test_the_page_says_it(tmp_path: Path) -> None:
    study = studied(tmp_path, Runner(Variant(2, 2.0)))
    markdown.write(study, tmp_path)
    text = (tmp_path / "cost.md").read_text()
    assert study.words() in text
    assert "| each further digit | x" in text
    assert "Runs that failed:" in text
    assert (
        json.loads((tmp_path / "cost.json").read_text())["failed"][0]["name"]
        == Variant(2, 2.0).name
    )


def test_a_calibration_tells_the_price_of_every_demo_in_the_plane() -> None:
    """A law is known for scenes of its kind, from builtin scenes that are small: half a minute of runs in all."""
    known = {calibration.kind(made) for made in builtin().values()}
    for path in DEMOS.glob("*.toml"):
        demo = load(path)
        assert demo.gdim == 3 or calibration.kind(demo) in known, path.name
    for name, made in builtin().items():
        found = counted(made)
        assert found is not None and found.unknowns < 40_000, name


def test_elevations_at_stations_are_compared_at_equal_times():
    """Of a wave sampled at steps that do not meet these times; from the elevation at time zero on."""
    waves = loads(
        f"""
{TANK}[surface]
elevation = "0.1*cos(pi*x)"
stations = [0.0, 0.25]
[time]
end = 3.0
step = 0.07
"""
    )
    times = np.append(np.arange(0.07, 3.0, 0.07), 3.0)
    heights = {"elevation_1": 0.1, "elevation_2": 0.1 * np.cos(np.pi / 4.0)}
    rows = [
        {"time": t} | {name: height * np.cos(t) for name, height in heights.items()} for t in times
    ]
    found = quantities.ComparedNumbers(waves).of_run(None, rows)
    at = 3.0 * np.arange(1, quantities.TIMES + 1) / quantities.TIMES
    exact = [height * np.cos(at) for height in heights.values()]
    assert [found[name] for name in quantities.ComparedNumbers(waves).columns] == pytest.approx(
        np.concatenate(exact), abs=1e-6
    )
    (goal,) = quantities.ComparedNumbers(waves).goals(found)
    assert goal.error(
        {name: 1.01 * value for name, value in found.items()}, found
    ) == pytest.approx(0.01)
