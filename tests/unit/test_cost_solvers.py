"""Solver options in a study of what accuracy costs: which there are, where they are tried, how they compare."""

import csv
import json
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_up_runs import COLUMNS, TIMED, Runner, quiet, scene, studied

from incipient.compat import PETSc
from incipient.cost import calibration, markdown, measurement, process
from incipient.cost import study as cost
from incipient.cost.command import chosen, summary
from incipient.cost.comparison import compared
from incipient.cost.ladder import QUICK, STEADY, Spread, ladder
from incipient.cost.measurement import MeasuredRun, Variant, quicker
from incipient.cost.records import completed, known_runs
from incipient.cost.solvers import SolverOptions, options
from incipient.cost.study import findings
from incipient.errors import SceneError
from incipient.pictures.charts.cost import draw
from incipient.scene import Scene, load, loads

SCENES = Path(__file__).parents[2] / "demos" / "scenes"
STEADILY = ("chords", "loose", "umfpack", "stabilised")


def factors_by(package: str) -> bool:
    """Whether this PETSc factors matrices by a package, tried on one of a single entry."""
    matrix = PETSc.Mat().createAIJ((1, 1), nnz=1, comm=PETSc.COMM_SELF)
    matrix.setValue(0, 0, 2.0)
    matrix.assemble()
    conditioner = PETSc.PC().create(PETSc.COMM_SELF)
    conditioner.setOperators(matrix)
    conditioner.setType("lu")
    conditioner.setFactorSolverType(package)
    try:
        conditioner.setUp()
    except PETSc.Error:
        return False
    return True


# UMFPACK is not in every PETSc: PyPI's has none.
TRIED = tuple(way for way in STEADILY if way != "umfpack" or factors_by("umfpack"))


# -- which there are ----------------------------------------------------------------------------------------


def test_only_what_means_something_is_varied() -> None:
    assert set(SolverOptions(scene()).others) == {*STEADILY, "superlu"}
    assert SolverOptions(scene("fluid.inertia=false")).others == ("umfpack", "superlu")
    in_time = SolverOptions(scene(TIMED)).others
    assert {"extrapolated", "bdf1", "loose"} <= set(in_time)
    assert not {"implicit", "bdf2", "printed", "chords"} & set(in_time)
    street = load(SCENES / "vortex_street.toml")
    assert SolverOptions(street).usual == ("extrapolated", "bdf1", "loose")
    assert SolverOptions(street).own == "bdf2, implicit convection"


def test_ways_asked_for() -> None:
    made = scene(TIMED)
    asked = ["own", "implicit", "bdf1+extrapolated", "extrapolated+bdf1", "bdf2+extrapolated"]
    assert SolverOptions(made).named(asked) == ("extrapolated+bdf1", "extrapolated")
    for wrong, said in (
        ("magic", "magic is not known; give some of: own, extrapolated, bdf1"),
        ("chords", "chords changes nothing in this scene"),
        ("bdf1+bdf2", "contradicts itself"),
        ("extrapolated+magic", "magic is not known"),
    ):
        with pytest.raises(SceneError, match=said):
            SolverOptions(made).named([wrong])
    with pytest.raises(SceneError, match="contradicts itself"):
        SolverOptions(scene()).named(["umfpack+superlu"])


def test_what_a_way_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    made = scene(TIMED, "numerics.tolerance=1e-8")
    changed = Variant(3, 1.5, 0.02, "extrapolated+bdf1").of(made)
    assert (changed.numerics.convection, changed.time.scheme, changed.time.step) == (
        "extrapolated",
        "bdf1",
        0.02,
    )
    assert Variant(2, 1.0, None, "loose").of(made).numerics.tolerance == pytest.approx(1e-5)
    assert (
        Variant(2, 1.0, None, "loose").of(scene("numerics.tolerance=0.01")).numerics.tolerance
        == 0.01
    )
    assert SolverOptions(load(SCENES / "pothole_4.toml")).settings("loose") == [
        "numerics.tolerance = 0.001",
        "numerics.interface_tolerance = 0.001",
    ]
    assert Variant(2, 1.0, None, "chords").of(scene()) == Variant(2, 1.0).of(scene())
    monkeypatch.setenv("PETSC_OPTIONS", "-log_view")
    chords = process.environment_of_one_rank(options("chords"))
    assert chords["PETSC_OPTIONS"] == "-log_view -fluid_ksp_type preonly"
    assert process.environment_of_one_rank()["PETSC_OPTIONS"] == "-log_view"


# -- on which variants -----------------------------------------------------------------------------------------


def test_usual_ways_are_tried_on_three_coarse_rungs() -> None:
    steps = ladder(scene(), STEADY)
    sizes = [variant.mesh_size for variant in steps.compared]
    assert sizes == pytest.approx([2.0, np.sqrt(2.0), 1.0])
    tried = [Variant(3, size, None, way) for size in sizes for way in TRIED]
    assert [variant for variant in steps.variants if variant.solver] == tried
    at = steps.variants.index(Variant(3, 1.0))
    assert steps.variants[at + 1].solver == "chords", "soon after the run that it is compared with"
    in_time = ladder(scene(TIMED), Spread((2, 3), (2.0, 1.4, 1.0)))
    assert in_time.compared == (Variant(2, 2.0, 0.04), Variant(2, 1.4, 0.04), Variant(2, 1.4, 0.02))
    assert not ladder(scene(), QUICK).compared


def test_ways_asked_for_are_tried_on_all_rungs() -> None:
    wanted = chosen(scene(), True, solvers=["own", "chords"])
    steps = ladder(scene(), wanted)
    assert len(steps.variants) == 8
    assert {replace(variant, solver="") for variant in steps.variants if variant.solver} == set(
        steps.compared
    )
    assert not steps.reference.solver
    assert not ladder(scene(), chosen(scene(), False, solvers=["own"])).compared


def test_what_auto_decides_anyway_is_no_other_way() -> None:
    """Stabilisation is on where V h/(k nu) exceeds 50: here on the coarse cells only."""
    made = scene("fluid.reynolds=100.0")
    steps = ladder(made, Spread((2,), (4.0, 0.5), solvers=("stabilised", "unstabilised")))
    assert [
        (variant.mesh_size, variant.solver) for variant in steps.variants if variant.solver
    ] == [
        (4.0, "unstabilised"),
        (0.5, "stabilised"),
    ]


# -- how they compare ---------------------------------------------------------------------------------------


class Varied(Runner):
    """Chords give the same in half of the time beyond the first second; loose tolerances are off by 2%."""

    def __call__(self, scene: Scene, variant: Variant) -> MeasuredRun:
        run = super().__call__(scene, variant)
        if variant.solver == "chords":
            return replace(
                run, cpu=1.0 + 0.5 * (run.cpu - 1.0), counts=replace(run.counts, newton=10)
            )
        if variant.solver == "loose":
            off = {name: 1.02 * value for name, value in run.found.items()}
            return replace(run, found=off, cpu=1.0 + 0.95 * (run.cpu - 1.0))
        return run


def test_a_way_that_is_as_accurate_in_less_time_takes_the_place_on_the_front(
    tmp_path: Path,
) -> None:
    study = studied(tmp_path, Varied(), ways=("chords", "loose"))
    own = studied(tmp_path / "own", Varied(), ways=())
    best = [study.judged[index] for index in study.front]
    assert {one.run.variant.solver for one in best} == {"chords"}
    assert len(study.judged) == 3 * len(own.judged)
    law, before = study.laws["cpu"], own.laws["cpu"]
    assert law is not None and before is not None
    assert law.start == pytest.approx(before.start), (
        "what starting takes is told by the scene's own way"
    )
    assert law.time(1e-4) < before.time(1e-4)
    assert [one.errors for one in own.judged] == [
        one.errors for one in study.judged if not one.run.variant.solver
    ]

    chords, loose = study.solvers()
    assert chords.solver == "chords" and chords.cheaper
    # The runs start in half a second; the other half of the first one is theirs.
    ratios = [
        (0.5 + 0.1 * n) / (0.5 + 0.2 * n)
        for p in (2, 3, 4)
        for n in p * np.array([0.25, 0.5, 1, 2, 4])
    ]
    assert (chords.time, chords.time_at_error) == pytest.approx(
        (np.exp(np.mean(np.log(ratios))),) * 2
    )
    assert (chords.error, chords.newton) == pytest.approx((1.0, 2.0))
    assert chords.on_front == len(study.front) and chords.change == 0.0
    assert len(chords.variants) == 15 and chords.memory == 1.0
    assert not loose.cheaper
    assert loose.change == pytest.approx(0.02, rel=0.03)


def test_time_at_equal_errors(tmp_path: Path) -> None:
    """Own: error 0.02 (h/2)^5 in order 3, time beyond the start 0.5 + 0.6 h^-2.

    A way with twice the error in the same time takes 2^slope of the time for the same error, with the slope of
    log(time) against -log(error).
    """

    class Worse(Runner):
        def __call__(self, scene: Scene, variant: Variant) -> MeasuredRun:
            run = super().__call__(scene, variant)
            exact = {"force_x": 3.0, "force_y": 4.0, "couple": 0.5, "safety_factor": 1.5}
            twice = {name: 2.0 * value - exact[name] for name, value in run.found.items()}
            return replace(run, found=twice) if variant.solver == "loose" else run

    study = studied(tmp_path, Worse(), ways=None)
    (loose,) = (one for one in study.solvers() if one.solver == "loose")
    h = np.array([2.0, np.sqrt(2.0), 1.0])
    slope = -np.polyfit(5.0 * np.log(h), np.log(0.5 + 0.6 * h**-2), 1)[0]
    assert (loose.time, loose.error) == (1.0, pytest.approx(2.0, rel=0.01))
    assert loose.time_at_error == pytest.approx(2.0**slope, rel=0.01)
    assert not loose.cheaper


def test_page_and_picture_show_them(tmp_path: Path) -> None:
    study = studied(tmp_path, Varied(), ways=None)
    markdown.write(study, tmp_path)
    text = (tmp_path / "cost.md").read_text()
    # Time (0.5 + 0.3 n)/(0.5 + 0.6 n) for n = 1/4, 1/2, 1: the geometric mean is 0.81.
    assert "| chords | x 0.81 | x 0.81 | x 1 | 0% | x 1 | x 2 | x 1 | Newton's method" in text
    assert '`PETSC_OPTIONS="-fluid_ksp_type preonly"` |' in text
    assert "on 3 variants, geometric means. Time" in text
    assert "by a tenth on the whole and on every variant: *chords* (x 0.81)." in text
    assert "| P3-P2, mesh_size 1, chords | " in text
    said = "chords: time x 0.81, error x 1, change 0%, time at equal errors x 0.81: cheaper"
    assert f"solver              {said}" in summary(study, tmp_path)
    stored = json.loads((tmp_path / "cost.json").read_text())
    assert {run["solver"] for run in stored["runs"]} == {"", *TRIED}
    assert stored["solvers"][0]["solver"] == "chords"
    (picture,) = draw(tmp_path)
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_without_other_ways_nothing_is_said_of_them(tmp_path: Path) -> None:
    study = studied(tmp_path, Runner())
    assert "Solver options" not in markdown.page(study)
    assert not compared(study.judged, study.front, study.goals)


def test_laws_are_of_the_scenes_own_way(tmp_path: Path) -> None:
    (found,) = findings(studied(tmp_path / "all", Varied(), ways=("chords", "loose"))).values()
    (own,) = findings(studied(tmp_path / "own", Varied(), ways=())).values()
    assert found == replace(own, cheaper=found.cheaper)
    assert set(found.cheaper) == {"chords"} and not own.cheaper


# -- what is kept -------------------------------------------------------------------------------------------


def earlier(directory: Path) -> None:
    """Take from a study what versions without solver options had not."""
    rows = list(csv.DictReader((directory / "cost.csv").open()))
    heads = [name for name in rows[0] if name != "solver"]
    with (directory / "cost.csv").open("w") as stream:
        writer = csv.DictWriter(stream, heads, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def test_a_study_of_an_earlier_version_goes_on(tmp_path: Path) -> None:
    studied(tmp_path, Runner())
    earlier(tmp_path)
    before = (tmp_path / "cost.csv").read_bytes()
    assert len(known_runs(COLUMNS, tmp_path)) == 16
    assert (tmp_path / "cost.csv").read_bytes() == before, "reading changes nothing"
    again, said = Varied(), list[str]()
    made = scene()
    study = cost.run_ladder(made, ladder(made, STEADY), tmp_path, again, said.append)
    # The runs that others are compared with are made with them.
    assert [variant.key for variant in again.made] == [
        replace(variant, solver=way).key
        for variant in study.ladder.compared
        for way in ("", *TRIED)
    ]
    assert said[0].startswith(f"{tmp_path}: of an earlier version; its runs are kept")
    assert len(study.judged) == 15 + 3 * len(TRIED)
    assert not completed(tmp_path, study.ladder.compared), "once"
    third = Varied()
    cost.run_ladder(made, ladder(made, STEADY), tmp_path, third, quiet)
    assert not third.made


def test_an_interrupted_study_of_ways_goes_on(tmp_path: Path) -> None:
    class Stopped(Varied):
        def __call__(self, scene: Scene, variant: Variant) -> MeasuredRun:
            if len(self.made) == 2:
                raise KeyboardInterrupt
            return super().__call__(scene, variant)

    first, second = Stopped(), Varied()
    with pytest.raises(KeyboardInterrupt):
        studied(tmp_path, first, quick=True, ways=("chords",))
    studied(tmp_path, second, quick=True, ways=("chords",))
    assert [variant.solver for variant in first.made] == ["", "chords"]
    assert len(second.made) == 7


def test_short_runs_are_made_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter([2.0, 1.5, 4.0, 4.5, 6.0])
    monkeypatch.setattr(
        measurement, "measure", lambda scene, variant: MeasuredRun(variant, 9.0, next(times))
    )
    assert [quicker(scene(), Variant(2, 1.0)).cpu for _ in range(3)] == [1.5, 4.0, 6.0]
    monkeypatch.setattr(
        measurement, "measure", lambda scene, variant: MeasuredRun(variant, 1.0, 1.0, failed="no")
    )
    assert quicker(scene(), Variant(2, 1.0)).failed == "no"


def test_a_process_is_measured_from_outside(tmp_path: Path) -> None:
    text = "import os, sys; print(sys.stdin.read(), os.getcwd(), os.environ['A']); sys.exit('why')"
    used = process.run(
        [sys.executable, "-c", text], {**os.environ, "A": "b"}, tmp_path, given="given"
    )
    assert (used.exit_code, used.output, used.errors) == (1, f"given {tmp_path} b\n", "why\n")
    assert used.wall > 0.0 and used.cpu > 0.0 and used.peak_mib > 1.0
    killed = process.run([sys.executable, "-c", "import os; os.kill(os.getpid(), 9)"], apart=True)
    assert killed.exit_code == -9


def test_scenes_of_studies_differ_by_more_than_how_they_are_solved() -> None:
    """The digest tells convection apart, which the calibration is to know, and not what a variant changes."""
    base = loads((SCENES / "vortex_street.toml").read_text())
    assert calibration.digest(Variant(2, 1.4, 0.01, "loose").of(base)) == calibration.digest(base)
    assert calibration.digest(Variant(2, 1.4, 0.01, "extrapolated").of(base)) != calibration.digest(
        base
    )
