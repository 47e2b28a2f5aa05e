"""What `incipient plan` foretells by the laws of studies: time, memory, errors, the last mesh, ways that are cheaper.

Laws and runs are made up, so that what follows from them is known; tests/end_to_end compares with real runs.
"""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from made_up_runs import TIMED, Runner, scene, studied

from incipient.accuracy import next_mesh
from incipient.accuracy.first_mesh import first_mesh
from incipient.accuracy.next_mesh import AIM, GAIN, UNKNOWNS
from incipient.cost import calibration
from incipient.cost.calibration import Findings
from incipient.cost.command import predicted_plan
from incipient.cost.laws import ErrorLaw, TimeLaw, error_at, fitted_errors, fitted_time
from incipient.cost.markdown import write
from incipient.cost.measurement import MeasuredRun, Variant
from incipient.cost.prediction import (
    COARSE,
    KnownLaws,
    LastMesh,
    Prediction,
    known_laws,
    predict,
)
from incipient.cost.study import findings
from incipient.effects.plan import make_plan
from incipient.errors import OutputError
from incipient.planning.plan import Estimate
from incipient.scene import Scene, load

SCENES = Path(__file__).parents[2] / "demos" / "scenes"
QUIET = "numerics.error_bars=false"
FIRST = Estimate(200, 1000, 200.0)
TIME = TimeLaw(start=0.5, fixed=0.5, solution=1e-4, step=1e-5, power=1.0)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "incipient" / "calibration.json"


def calibrated(made: Scene, law: ErrorLaw, goal: str = "force") -> None:
    """A machine on which the law of times and that of one error are known."""
    found = Findings(
        "a study", calibration.kind(made), TIME, 1.1, {goal: {2: law}}, {"chords": 0.6}
    )
    calibration.add({calibration.digest(made): found})


def predicted(made: Scene) -> tuple[Prediction, LastMesh]:
    found = predict(known_laws(made), FIRST)
    assert isinstance(found, Prediction) and found.last is not None, found
    return found, found.last


# -- laws ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("power", [1.0, 1.3])
def test_a_law_of_times_is_found_again(power: float) -> None:
    """0.7 + 0.4 + n^p (2e-6 + 1e-7 m)."""
    law = TimeLaw(0.7, 0.4, 2e-6, 1e-7, power)
    n, m = np.array([2000, 4000, 4000, 8000, 32000]), np.array([20.0, 20.0, 40.0, 40.0, 80.0])
    cpu = np.array([law.seconds([run], []) for run in zip(n, m, strict=True)])
    found = fitted_time(n.astype(float), m, cpu, 0.7)
    assert asdict(found) == pytest.approx(asdict(law), rel=1e-6)
    steady = fitted_time(n.astype(float), 0.0 * m, 1.1 + 3e-5 * n, 0.7)
    assert steady.seconds([(100000, 0.0)], []) == pytest.approx(4.1)


def test_runs_in_one_process_start_once() -> None:
    """Fixed costs 0.5 (1 + 0.3) for two runs, 0.1 and 0.2 for their unknowns, 0.3 for those of a dual solution."""
    assert TIME.seconds([(1000, 0.0), (2000, 0.0)], [3000]) == pytest.approx(0.5 + 0.65 + 0.6)
    assert TIME.seconds([(1000, 10.0)], []) == pytest.approx(1.0 + 0.1 + 0.1)


def test_laws_of_errors_are_found_again() -> None:
    """0.03 h^3 + 2 dt^2 and 0.01 h^5."""
    seen = [(2, h, t, 0.03 * h**3 + 2.0 * t**2) for h in (2.0, 1.4, 1.0) for t in (0.1, 0.05)]
    seen += [(3, h, 0.0, 0.01 * h**5) for h in (2.0, 1.0)]
    laws = fitted_errors(np.array(seen), rate=2.0)
    assert error_at(laws, 2, 0.7, 0.02)[0] == pytest.approx(0.03 * 0.7**3 + 2.0 * 0.02**2, rel=1e-6)
    assert error_at(laws, 3, 0.5, 0.0) == pytest.approx((0.01 / 32, 1.0), rel=1e-6)
    assert error_at(laws, 4, 0.5, 0.0)[1] >= 3.0, (
        "an order that was not measured is known less well"
    )
    assert fitted_errors(np.empty((0, 4)), 2.0) == {}
    # Off by a factor of two up and down at each size: the straight line in logarithms, found by hand.
    scattered = [(2, h, 0.0, 0.01 * h**3 * off) for h in (2.0, 1.0, 0.5) for off in (2.0, 0.5)]
    law = fitted_errors(np.array(scattered), 2.0)[2]
    assert (law.mesh, law.power, law.scatter) == pytest.approx((0.01, 3.0, 2.0))


# -- what is known ------------------------------------------------------------------------------------------


def test_a_study_predicts_its_scene(tmp_path: Path) -> None:
    study = studied(tmp_path / "study", Runner())
    calibration.add(findings(study))
    calibration.add(findings(study))
    assert len(calibration.read()) == 1, "kept once"
    made = scene(QUIET, "numerics.mesh_size=1.2", "numerics.order=2")
    found = predict(known_laws(made), Estimate(555, round(4000 * 1.2**-2), 200.0))
    assert isinstance(found, Prediction) and found.own
    # What starting takes is fitted as well: 6% more than was made up.
    assert found.cpu == pytest.approx(1.0 + 0.2 * 1.2**-2 * 2, rel=0.15)
    assert found.errors["force"].value == pytest.approx(0.02 * 0.6**4, rel=0.01)
    assert "by runs of this scene on this machine" in found.text()
    foreign = predict(known_laws(scene("fluid.reynolds=21.0", QUIET)), FIRST)
    assert isinstance(foreign, Prediction) and not foreign.own
    assert (found.factor, foreign.factor) == (1.4, 2.0)
    assert foreign.errors["force"].factor >= 5.0
    assert "by runs of other scenes on this machine" in foreign.text()


def test_without_a_calibration_that_shipped_serves(cache: Path) -> None:
    for made in (scene(QUIET), scene(TIMED, QUIET), load(SCENES / "pothole_4.toml")):
        found = predict(known_laws(made), FIRST)
        assert isinstance(found, Prediction)
        assert found.factor == 3.0 and found.cpu > 0.5 and found.peak_mib > 100.0
        assert "on another machine" in found.text()
        assert set(found.errors) == ({"place", "angle"} if made.body.moves else {"force", "couple"})
    assert not cache.exists()


def test_a_study_given_comes_first(tmp_path: Path) -> None:
    calibrated(scene(), ErrorLaw(0.01, 2.0, 0.0, 2.0, 1.0))
    study = studied(tmp_path / "study", Runner())
    write(study, tmp_path / "study")
    known = known_laws(scene(), tmp_path / "study")
    assert known.own and known.findings == tuple(findings(study).values())
    assert known.where == f"by runs of this scene in {tmp_path / 'study'}"
    other = known_laws(scene("fluid.reynolds=21.0"), tmp_path / "study")
    assert not other.own and other.findings == known.findings
    in_time = known_laws(scene(TIMED), tmp_path / "study")
    assert in_time.where == "by runs of other scenes on another machine", (
        "a study of steady flow says nothing"
    )
    with pytest.raises(
        OutputError, match="holds no study that can be understood; make it with `incipient cost`"
    ):
        known_laws(scene(), tmp_path)


def test_a_damaged_calibration_is_none(cache: Path) -> None:
    law = ErrorLaw(0.01, 2.0, 0.0, 2.0, 1.0)
    calibrated(scene(), law)
    for content in ("{", "[]", '{"schema_version": 2, "machines": {}}', '{"schema_version": 1}'):
        cache.write_text(content)
        assert not calibration.read()
    calibrated(scene(), law)
    stored = cache.read_text()
    for name in ("power", "kind"):  # of a law, of findings
        cache.write_text(stored.replace(f'"{name}":', f'"more": 1, "{name}":', 1))
        assert not calibration.read(), f"{name} of another version"
    cache.write_text(stored)
    (found,) = calibration.read().values()
    assert found.errors == {"force": {2: law}} and found.time == TIME


def test_calibrations_of_other_machines_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    calibrated(scene(), ErrorLaw(0.01, 2.0, 0.0, 2.0, 1.0))
    here = calibration.read()
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(calibration, "machine", lambda: "another")
        assert not calibration.read()
        calibrated(scene(TIMED), ErrorLaw(0.01, 2.0, 0.0, 2.0, 1.0))
    assert calibration.read() == here


# -- cheaper ways -------------------------------------------------------------------------------------------


class Chords(Runner):
    """Chords give the same in half of the time beyond the first second."""

    def __call__(self, scene: Scene, variant: Variant) -> MeasuredRun:
        run = super().__call__(scene, variant)
        return replace(run, cpu=1.0 + 0.5 * (run.cpu - 1.0)) if variant.solver == "chords" else run


def test_the_plan_tells_of_ways_that_a_study_found_to_be_cheaper(tmp_path: Path) -> None:
    study = studied(tmp_path / "study", Chords(), ways=None)
    write(study, tmp_path / "study")
    (chords,) = (one for one in study.solvers() if one.solver == "chords")
    set_by = f'PETSC_OPTIONS="-fluid_ksp_type preonly" took {chords.time:.2g} of the time at the same error'
    known = known_laws(scene(), tmp_path / "study")
    assert known.cheaper() == [f"{set_by} in the last study"]
    other = known_laws(scene("fluid.reynolds=21.0"), tmp_path / "study")
    assert other.cheaper() == [f'{set_by} in the study of "{scene().title}"']
    stokes = scene("fluid.inertia=false")
    assert not known_laws(stokes, tmp_path / "study").cheaper(), (
        "chords are nothing to a linear system"
    )


def test_plan_as_data_and_in_words() -> None:
    made = scene("numerics.accuracy=verdict")
    calibrated(made, ErrorLaw(1e-3, 2.0, 0.0, 2.0, 1.0))
    found = predicted_plan(made)
    told = json.loads(json.dumps(found.to_dict()))
    assert told["prediction"] is None and told["estimate"]["unknowns"] > 0
    assert told["cheaper"] == [
        'PETSC_OPTIONS="-fluid_ksp_type preonly" took 0.6 of the time at the same error in the last study'
    ]
    assert found.text().endswith(f"  {told['cheaper'][0]}")


# -- the first mesh -----------------------------------------------------------------------------------------


def test_the_plan_says_that_the_run_chooses() -> None:
    made = scene("numerics.accuracy=0.001", "numerics.budget_seconds=60")
    text = predicted_plan(made).text()
    sought = "mesh and order are chosen by the run, until the error of the force "
    sought += "(of discretisation) is below 0.001, within 60 s"
    assert f"numerics.accuracy: {sought}" in text
    assert "P2-P1 Taylor-Hood on cells of order 2 at first" in text
    assert "cell sizes x" not in text
    assert "first mesh: 342 cells, 1749 unknowns" in text, "as in docs/accuracy.md"
    assert not make_plan(scene()).sought
    assert "cell sizes x 1" in make_plan(scene()).text()
    assert "until the verdict is decided" in make_plan(scene("numerics.accuracy=verdict")).text()
    assert (
        "steps, mesh and order are chosen"
        in make_plan(scene(TIMED, "numerics.accuracy=0.01")).text()
    )


def test_the_first_mesh_in_time_is_that_of_the_coarsest_run() -> None:
    made = scene(TIMED, "numerics.accuracy=0.01")
    coarse = next_mesh.first(made)
    assert (coarse.numerics.mesh_size, coarse.time.step) == (
        pytest.approx(2.0**1.5),
        pytest.approx(0.08),
    )
    estimate = predicted_plan(scene(TIMED, QUIET)).plan.estimate
    assert estimate is not None
    assert first_mesh(made).unknowns < 0.7 * estimate.unknowns


# -- the last mesh ------------------------------------------------------------------------------------------


def test_an_error_that_is_small_at_first() -> None:
    """0.02 (h/4)^2 percent at cells four times as large, and what is more on cells as coarse."""
    made = scene(QUIET, "numerics.accuracy=0.001")
    calibrated(made, ErrorLaw(0.0002 / 16.0, 2.0, 0.0, 2.0, 1.0))
    found, last = predicted(made)
    assert last.first.value == pytest.approx(COARSE * 2e-4)
    assert (last.meshes, last.unknowns, last.order, last.reaches, found.own) == (
        1,
        1000,
        2,
        True,
        True,
    )
    assert "the first mesh is expected to do" in found.text()


@pytest.mark.parametrize(("asked", "order"), [(4e-3, 2), (8e-4, 3), (2e-5, 4)])
def test_the_second_mesh_is_as_the_run_will_choose_it(asked: float, order: int) -> None:
    made = scene(QUIET, f"numerics.accuracy={asked}")
    calibrated(made, ErrorLaw(0.01 / COARSE / 16.0, 2.0, 0.0, 2.0, 1.0))
    found, last = predicted(made)
    left = max(0.01 * GAIN ** (order - 2) / (AIM * asked), 1.0)
    unknowns = 1000 * UNKNOWNS[2][order] / UNKNOWNS[2][2] * left ** (1.0 / order)
    assert (last.meshes, last.order) == (2, order)
    assert last.unknowns == pytest.approx(unknowns, rel=0.01)
    assert (
        f"2 meshes expected, the last of about {float(f'{unknowns:.2g}'):.0f} unknowns"
        in found.text()
    )
    assert found.cpu > TIME.seconds([(1000, 0.0), (last.unknowns, 0.0)], [1000])


def test_error_bars_come_on_top() -> None:
    made = scene("numerics.accuracy=0.001")
    calibrated(made, ErrorLaw(1e-5, 2.0, 0.0, 2.0, 1.0))
    quiet = scene(QUIET, "numerics.accuracy=0.001")
    assert predicted(made)[0].cpu > predicted(quiet)[0].cpu


def test_flow_in_time_is_refined_as_its_search_will() -> None:
    """An error of 5 dt^2, dt in units of the flow's time: steps of 0.08 at first, then such that 0.7 of it is left."""
    made = scene(TIMED, QUIET, "numerics.accuracy=0.001")
    unit = calibration.step_of_flow(1.0, made.reference_velocity, made.reference_length)
    calibrated(made, ErrorLaw(0.0, 2.0, 5.0 / unit**2, 2.0, 1.0))
    first = first_mesh(made)
    unknowns, found = first.unknowns, predict(known_laws(made), first)
    assert isinstance(found, Prediction) and found.last is not None
    last = found.last
    assert last.first.value == pytest.approx(5.0 * 0.08**2)
    assert (last.meshes, last.order, last.reaches) == (2, 2, True)
    wanted = next_mesh.AIM * 0.001
    assert last.step is not None and 0.8 * wanted < 5.0 * last.step**2 <= wanted
    steps = [made.time.end / step for step in (0.08, last.step)]
    longer = [max(count / 4.0, min(count / 2.0, 8.0)) for count in steps]
    alike = [(unknowns, count) for count in (*steps, *longer)]
    shares = (1.0, 1.5)
    low, high = (
        TIME.seconds([*alike, *((share * unknowns, n) for n in longer)], []) for share in shares
    )
    assert low < found.cpu < high, "each is compared with two others, one of them of a higher order"
    _, easy = predicted(scene(TIMED, QUIET, "numerics.accuracy=0.05"))
    assert (easy.meshes, easy.step) == (1, pytest.approx(0.08))


def test_an_error_that_is_far_off_is_not_reached() -> None:
    """Steps become at most sixteen times shorter from run to run, and the error so 256 times smaller."""
    made = scene(TIMED, QUIET, "numerics.accuracy=1e-5")
    calibrated(made, ErrorLaw(0.0, 2.0, 1e12, 2.0, 1.0))
    found, last = predicted(made)
    assert (last.meshes, last.reaches) == (6, False)
    assert "6 meshes expected, not to be reached, the last of about" in found.text()


# -- what is not known --------------------------------------------------------------------------------------


def test_what_has_no_law_is_not_known() -> None:
    made = scene("numerics.accuracy=0.001", "numerics.accuracy_of=couple")
    calibrated(made, ErrorLaw(1e-3, 2.0, 0.0, 2.0, 1.0))
    unknown = "  final mesh, time and memory: not known: "
    assert predict(known_laws(made), FIRST) == (
        f"{unknown}no error of the couple is known for scenes of this kind; run `incipient cost SCENE`"
    )
    verdict = predict(known_laws(scene("numerics.accuracy=verdict")), FIRST)
    assert (
        verdict
        == f"{unknown}they depend on what decides the verdict; numerics.budget_seconds limits the time"
    )
    carried = load(SCENES / "pothole_4.toml", ["numerics.accuracy=0.01"])
    assert "the load on a grain that moves" in str(predict(known_laws(carried), FIRST))
    adaptive = scene(TIMED.replace("step", "tolerance = 1e-3, step"), "numerics.accuracy=0.01")
    assert "steps that adapt" in str(predict(known_laws(adaptive), FIRST))


def test_laws_of_other_scenes_are_trusted_less() -> None:
    made = scene(QUIET, "numerics.accuracy=0.002")
    calibrated(made, ErrorLaw(0.01 / 16.0, 2.0, 0.0, 2.0, 1.0))
    (own, last), (other, of_other) = (
        predicted(one)
        for one in (made, scene(QUIET, "numerics.accuracy=0.002", "fluid.reynolds=21.0"))
    )
    assert own.own and not other.own
    assert of_other.first.factor > last.first.factor and other.factor > own.factor


def test_several_studies_count_alike() -> None:
    """The geometric mean of 0.01 and 0.04, and the factor that covers both."""
    studies = [
        Findings("", "steady", TIME, 1.0, {"force": {2: ErrorLaw(error, 2.0, 0.0, 2.0, 1.0)}})
        for error in (0.01, 0.04)
    ]
    known = KnownLaws(scene(), tuple(studies), False, 2.0, "")
    found = known.errors(Variant(2, scene().numerics.mesh_size))["force"]
    assert found.value == pytest.approx(0.02)
    assert found.factor == 5.0
    assert known.mean(lambda one: one.time.start) == pytest.approx(0.5)
