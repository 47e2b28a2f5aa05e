"""Forces of another program on a grain and a bed from files of triangles; motion in time and the flow that moves it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scenes import message

from incipient import cli
from incipient.judging.case import Case, load_case_without_flow
from incipient.judging.forces import JudgedForces, judge_forces
from incipient.judging.in_place import grain_in_place
from incipient.judging.motion import MotionInTime
from incipient.judging.openfoam import ForcesInTime, read_forces
from incipient.judging.series import judge_series
from incipient.scene import loads

BLOCK = Path(__file__).parents[2] / "demos" / "cases" / "openfoam_block"
FORCES = BLOCK / "postProcessing" / "forces"
# As of case.toml: a mass of 1.65 and a weight less buoyancy of 6 for a volume of one.
SET = [
    "body.density=1.65",
    "fluid.density=1",
    f"gravity.acceleration={6 / 0.65}",
    "contact.friction=0.5",
    "errors.samples=10",
]
DOWN = "gravity.direction=[0, -1, 0]"


def in_place(
    *overrides: str, grain: Path | None = BLOCK / "block.stl", bed: Path = BLOCK / "bed.stl"
) -> Case:
    return grain_in_place(grain, bed, [*SET, DOWN, *overrides])


def verdict(case: Case, found: ForcesInTime | None = None, **options: Any) -> JudgedForces:
    return judge_forces(case, found or read_forces(FORCES), 1.0, 5.0, **options)


BOX = ("body.shape=box", "body.sides=[1, 1, 1]", "body.centre=[4.5, 0.5, 0.5]")


@pytest.mark.parametrize("how", ["files", "box on a plane"])
def test_the_shipped_block_is_judged_as_by_its_case(how: str) -> None:
    """Contacts, weight and inertia found from the surfaces give the verdict of those in case.toml."""
    case = in_place() if how == "files" else in_place(*BOX, grain=None, bed=Path("flat"))
    given = load_case_without_flow(BLOCK / "case.toml", ["errors.samples=10"])
    mine, theirs = verdict(case), verdict(given)
    factors = [one.judgement["verdict"]["safety_factor"] for one in (mine, theirs)]
    assert factors[0] == pytest.approx(factors[1], rel=1e-6)
    assert mine.series.batch.factors == pytest.approx(theirs.series.batch.factors, rel=1e-6)
    assert mine.series.batch.mode_names == theirs.series.batch.mode_names
    mass_and_inertia = case.mass_and_inertia()
    assert mass_and_inertia is not None
    assert mass_and_inertia[0] == pytest.approx(1.65)
    assert mass_and_inertia[1] == pytest.approx(0.275 * np.eye(3), abs=1e-12)


def test_moving_the_point_of_the_moments_changes_nothing() -> None:
    """M_a = M_b + (b - a) ^ F, Varignon's theorem."""
    found = read_forces(FORCES)
    shift = np.array([2.0, -1.0, 0.7])
    moments = found.moments - np.cross(shift, found.forces)
    moved = ForcesInTime(found.times, found.forces, moments, found.centre + shift)
    case = in_place()
    one, other = verdict(case), verdict(case, moved)
    assert one.series.batch.factors == pytest.approx(other.series.batch.factors, rel=1e-7)
    assert one.series.batch.mode_names == other.series.batch.mode_names


def test_a_turned_frame_changes_nothing(tmp_path: Path) -> None:
    """The run, its grain and bed turned together, gravity with them."""
    turn = trimesh.transformations.random_rotation_matrix(np.array([0.1, 0.6, 0.3]))
    for name in ("block", "bed"):
        surface = trimesh.load(BLOCK / f"{name}.stl")
        surface.apply_transform(turn).export(tmp_path / f"{name}.stl")
    matrix, found = turn[:3, :3], read_forces(FORCES)
    turned = ForcesInTime(
        found.times, found.forces @ matrix.T, found.moments @ matrix.T, matrix @ found.centre
    )
    down = f"gravity.direction={(-matrix[:, 1]).tolist()}"
    # STL holds single precision.
    case = grain_in_place(
        tmp_path / "block.stl", tmp_path / "bed.stl", [*SET, down, "contact.tolerance=1e-4"]
    )
    one, other = verdict(in_place()), verdict(case, turned)
    factors = [judged.judgement["verdict"]["safety_factor"] for judged in (one, other)]
    assert factors[0] == pytest.approx(factors[1], rel=1e-5)


def test_a_sphere_on_three_in_place(tmp_path: Path) -> None:
    """Three of radius one in a triangle, one upon them: contacts at 1/sqrt 3 of the radius off the axis."""
    middles = [
        [2.0 / np.sqrt(3.0) * np.cos(a), 2.0 / np.sqrt(3.0) * np.sin(a)]
        for a in np.radians([0, 120, 240])
    ]
    x, y = np.meshgrid(np.linspace(-1.2, 1.2, 121), np.linspace(-1.2, 1.2, 121))
    heights = np.max(
        [np.sqrt(np.maximum(1.0 - (x - a) ** 2 - (y - b) ** 2, 0.0)) for a, b in middles], axis=0
    )
    points = np.stack([x, y, heights], axis=2).reshape(-1, 3)
    first = (np.arange(120)[:, None] * 121 + np.arange(120)).ravel()
    triangles = np.vstack(
        [
            np.stack([first, first + 1, first + 122], 1),
            np.stack([first, first + 122, first + 121], 1),
        ]
    )
    trimesh.Trimesh(points, triangles, process=False).export(tmp_path / "bed.ply")
    height = np.sqrt(4.0 - 4.0 / 3.0)
    case = grain_in_place(
        None,
        tmp_path / "bed.ply",
        [
            *SET,
            "body.shape=sphere",
            "body.diameter=2",
            f"body.centre=[0, 0, {height}]",
            "contact.tolerance=1e-3",
            "bed.cell=[0.02, 0.02]",
        ],
    )
    points = case.to_contacts().points
    assert len(points) == 3
    assert np.hypot(points[:, 0], points[:, 1]) == pytest.approx(
        np.full(3, 1.0 / np.sqrt(3.0)), abs=1e-2
    )


IN_SCENE = """
domain = {length = 12, width = 10, height = 6}
fluid = {reynolds = 0.1, scale = "grain"}
flow = {kind = "shear"}
body = {shape = "mesh", file = "block.stl", x = 5}
bed = {kind = "flat"}
"""


@pytest.mark.parametrize("fault", ["turned", "twice"])
def test_a_repaired_surface_stands_where_its_file_has_it(tmp_path: Path, fault: str) -> None:
    """The block of its file, a unit cube, with three triangles turned inside out, or two given twice."""
    block = trimesh.load(BLOCK / "block.stl")
    faces = block.faces.copy()
    if fault == "turned":
        faces[:3] = faces[:3, ::-1]
    else:
        faces = np.vstack([faces, faces[:2, ::-1]])
    path = tmp_path / "block.stl"
    trimesh.Trimesh(block.vertices, faces, process=False).export(path)
    case = in_place(grain=path)
    assert case.load.centre == pytest.approx((4.5, 0.5, 0.5), abs=1e-7)
    factors = [verdict(one).judgement["verdict"]["safety_factor"] for one in (case, in_place())]
    assert factors[0] == pytest.approx(factors[1], rel=1e-6)
    scenes = [loads(IN_SCENE, folder) for folder in (tmp_path, BLOCK)]
    for scene in scenes:
        assert scene.grain is not None and scene.placement is not None
        assert scene.placement.centre == pytest.approx((5.0, 5.0, 0.5), abs=1e-7)
        assert scene.grain.volume == pytest.approx(1.0, abs=1e-7)


@pytest.mark.parametrize(
    ("overrides", "grain", "bed", "said"),
    [
        ([], None, Path("flat"), "--grain is missing"),
        ([], BLOCK / "block.stl", None, "--bed is missing"),
        (
            SET[1:],
            BLOCK / "block.stl",
            Path("flat"),
            "body.density is missing; add --set body.density=NUMBER",
        ),
        (SET[:1] + SET[2:], BLOCK / "block.stl", Path("flat"), "fluid.density is missing"),
        (SET, BLOCK / "block.stl", BLOCK / "bed.stl", "upwards is against gravity.direction"),
        (
            [*SET, DOWN, "gravity.direction=[0, 0, 0]"],
            BLOCK / "block.stl",
            Path("flat"),
            "direction: is zero",
        ),
        (
            [*SET, DOWN, "bed.height=-0.1"],
            BLOCK / "block.stl",
            Path("flat"),
            "of its size above the bed",
        ),
        ([*SET, DOWN, "bed.height=1"], BLOCK / "block.stl", BLOCK / "bed.stl", "leave it out"),
        # The block is 1 high: its centre is 0.3 above, or 0.1 below, a plane that it stands in.
        ([*SET, DOWN, "bed.height=0.2"], BLOCK / "block.stl", Path("flat"), "in the bed, by 0.115"),
        ([*SET, DOWN, "bed.height=0.6"], BLOCK / "block.stl", Path("flat"), "is below the bed"),
        ([*SET, DOWN, "bed.height=9"], BLOCK / "block.stl", Path("flat"), "is below the bed"),
        # Seen against a gravity of the wrong sign the bed is above the block.
        (
            [*SET, "gravity.direction=[0, 1, 0]"],
            BLOCK / "block.stl",
            BLOCK / "bed.stl",
            "the grain is below the bed; turn gravity.direction round",
        ),
        (SET, BLOCK / "bed.stl", Path("flat"), "bed.stl"),
        (SET, BLOCK / "absent.stl", Path("flat"), "absent.stl"),
        ([*SET, *BOX[:2]], None, Path("flat"), "neither x nor centre is given"),
    ],
)
def test_what_is_wrong_is_said(
    overrides: list[str], grain: Path | None, bed: Path | None, said: str
) -> None:
    assert said in message(lambda: grain_in_place(grain, bed, overrides))


def pulsating(count: int = 8_001, periods: int = 20) -> ForcesInTime:
    """A drag of 2 + cos(2 pi t) through the centre of the block, which slides from 3 on."""
    times = np.linspace(0.0, float(periods), count)
    drag = 2.0 + np.cos(2.0 * np.pi * times)
    forces = drag[:, None] * [1.0, 0.0, 0.0]
    return ForcesInTime(times, forces, 0.0 * forces, np.array([4.5, 0.5, 0.5]))


def test_motion_in_time_of_a_pulsating_force() -> None:
    """It moves while 2 + cos > 2.5, a third of each period, and begins once in it; F grows as U^2 and as U."""
    case = in_place("contact.friction=0.416666666666666667", *BOX, grain=None, bed=Path("flat"))
    for law, power in (("U", 1.0), ("U2", 2.0)):
        judged = judge_forces(case, pulsating(), 1.0, 0.0, law)
        motion, threshold = judged.series.motion, judged.threshold
        assert motion.probability == pytest.approx(1.0 / 3.0, abs=2e-3)
        assert motion.error is not None and motion.error < 0.02
        assert motion.rate == pytest.approx(1.0, rel=1e-9) and motion.low < 1.0 < motion.high
        assert threshold is not None and threshold.mean is not None
        assert threshold.mean[0] ** power == pytest.approx(2.5 / 2.0, rel=1e-3)
        for one in threshold.quantiles:
            # The drag is above 2 + cos(pi p) for a share p of the time.
            assert one.factor**power == pytest.approx(
                2.5 / (2.0 + np.cos(np.pi * one.probability)), rel=2e-3
            )
            assert one.low <= one.factor <= one.high


def test_a_series_that_never_moves(tmp_path: Path) -> None:
    case = in_place(*BOX, grain=None, bed=Path("flat"))
    times = np.arange(50.0)
    columns = {
        name: 0.0 * times for name in ("force_y", "force_z", "couple_x", "couple_y", "couple_z")
    }
    motion = judge_series(case, {"time": times, "force_x": 0.0 * times + 0.1, **columns}).motion
    assert (motion.probability, motion.error, motion.rate, motion.low) == (0.0, None, 0.0, 0.0)
    # No event in a time T: the rate is below 3/T with 95%, by Poisson's law.
    assert motion.high == pytest.approx(3.0 / 49.0)


PULSE = """\
[load]
weight = [0, -1]
centre = [0, 0.5]
flow_force = [0, 0]
flow_couple = 0
[contacts]
points = [[-0.5, 0], [0.5, 0]]
normals = [[0, -1], [0, -1]]
friction = 0.5
convex = true
"""


def test_a_series_is_taken_from_a_time_on(tmp_path: Path, capsys: Any) -> None:
    """A push of 0.8 at first and of 0.1 from time 2 on; friction holds 0.5."""
    case, series = tmp_path / "case.toml", tmp_path / "series.csv"
    case.write_text(PULSE)
    rows = [f"{t},{0.8 if t < 2 else 0.1},0,0" for t in (0, 1, 2, 3, 4)]
    series.write_text("time,force_x,force_y,couple\n" + "\n".join(rows) + "\n")
    words = ["judge", str(case), "--series", str(series), "--law", "U"]
    factors = {}
    for since in (None, "2"):
        out = tmp_path / f"from_{since}"
        more = [] if since is None else ["--since", since]
        assert cli.main([*words, *more, "--out", str(out)]) == 0
        factors[since] = json.loads((out / "series.json").read_text())["least_safety_factor"]
    assert factors[None] == pytest.approx(0.5 / 0.8) and factors["2"] == pytest.approx(0.5 / 0.1)
    said = capsys.readouterr().out
    assert "rest                100.000% of the time" in said and "from time 2 on" in said
    assert cli.main([*words, "--since", "5"]) == 2
    assert "nothing is there from 5 on; the last time is 4" in capsys.readouterr().err


def test_motion_past_the_end_is_refused() -> None:
    times = np.arange(5.0)
    for ask in (
        lambda: MotionInTime.of(times, times < 2.0, 9.0),
        lambda: judge_forces(in_place(), read_forces(FORCES), 1.0, 99.0, "U"),
    ):
        assert "the last time is" in message(ask)


@pytest.mark.parametrize(
    ("words", "needs"),
    [
        (["--since", "1"], "--since: goes with --forces or --series"),
        (["--law", "U"], "--law: goes with --forces or --series"),
        (["--jobs", "1"], "--jobs: goes with --batch"),
        (["--density", "1"], "--density: goes with --forces"),
        (["--grain", "a.stl"], "--grain: goes with --forces"),
        (["--bed", "flat"], "--bed: goes with --forces"),
    ],
)
def test_options_that_nothing_reads_are_refused(words: list[str], needs: str, capsys: Any) -> None:
    assert cli.main(["judge", str(BLOCK / "case.toml"), *words]) == 2
    assert needs in capsys.readouterr().err


def test_the_command(tmp_path: Path, capsys: Any) -> None:
    words = [
        "judge",
        "--forces",
        str(FORCES),
        "--density",
        "1",
        "--grain",
        str(BLOCK / "block.stl"),
    ]
    words += ["--bed", str(BLOCK / "bed.stl"), "--law", "U2", "--out", str(tmp_path / "out")]
    words += [word for one in (*SET, DOWN) for word in ("--set", one)]
    assert cli.main(words) == 0
    said = capsys.readouterr().out
    assert "probability at an instant 0, 100 samples" in said
    stored = json.loads((tmp_path / "out" / "judgement.json").read_text())
    factor = stored["verdict"]["safety_factor"]
    assert stored["threshold"]["mean"][0] == pytest.approx(np.sqrt(factor), rel=1e-12)
    assert len(stored["case"]["contacts"]["points"]) == 4
    assert cli.main([*words[:1], str(BLOCK / "case.toml"), *words[1:]]) == 2
    assert "leave one of them out" in capsys.readouterr().err
