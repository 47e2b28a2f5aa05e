"""Forces of another program: OpenFOAM's files, means with errors, grains in place, motion in time."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scenes import message
from scipy.signal import lfilter

from incipient.cli import main
from incipient.errors import SceneError
from incipient.judging.case import Case, load_case_without_flow
from incipient.judging.forces import JudgedForces, judge_forces
from incipient.judging.in_place import grain_in_place
from incipient.judging.motion import MotionInTime, mean_in_time
from incipient.judging.openfoam import ForcesInTime, read_forces
from incipient.judging.series import judge_series
from incipient.scene import loads

BLOCK = Path(__file__).parents[2] / "demos" / "cases" / "openfoam_block"
FORCES = BLOCK / "postProcessing" / "forces"
TIMES = np.arange(1, 61) * 0.1
PRESSURE = np.column_stack([1.0 + 0.1 * np.sin(9.0 * TIMES), 0.3 + 0.0 * TIMES, 0.0 * TIMES])
VISCOUS = np.column_stack([0.2 + 0.0 * TIMES, 0.05 * np.cos(7.0 * TIMES), 0.0 * TIMES])
PUSH = PRESSURE + VISCOUS
TWIST = np.column_stack([0.0 * TIMES, 0.0 * TIMES, -0.1 + 0.02 * np.sin(5.0 * TIMES)])
CENTRE = "# CofR          : (4.5 0.5 0)\n"


def numbers(values: np.ndarray, bracket: bool) -> str:
    text = " ".join(f"{one:.10e}" for one in values)
    return f"({text})" if bracket else text


def of_com(
    folder: Path, name: str = "", rows: slice = slice(None), factor: float = 1.0, **how: bool
) -> Path:
    """`force_NAME.dat` and `moment_NAME.dat`, vectors in brackets (up to 2012) or not; all but times times a factor."""
    folder.mkdir(parents=True, exist_ok=True)
    for kind, parts in (("force", (PRESSURE, VISCOUS)), ("moment", (0.7 * TWIST, 0.3 * TWIST))):
        parts = (*parts, 0.0 * PRESSURE) if how.get("porous") else parts
        columns = [factor * part[rows] for part in (sum(parts), *parts)]
        lines = [f"# {kind}\n{CENTRE}# Time total_x total_y total_z pressure_x pressure_y\n"]
        for time, *at in zip(TIMES[rows], *columns, strict=True):
            cells = (numbers(one, how.get("bracket", False)) for one in at)
            lines.append("\t".join([f"{time:g}", *cells]) + "\n")
        (folder / f"{kind}{name}.dat").write_text("".join(lines))
    return folder


def of_org(folder: Path, porous: bool = False) -> Path:
    """`forces.dat` with both, as openfoam.org and foam-extend write it."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"# Forces\n{CENTRE}# Time  \tforces(pressure viscous) moment(pressure viscous)\n"]
    for time, pressure, viscous, twist in zip(TIMES, PRESSURE, VISCOUS, TWIST, strict=True):
        more = f" {numbers(0.0 * twist, True)}" if porous else ""
        force = f"({numbers(pressure, True)} {numbers(viscous, True)}{more})"
        moment = f"({numbers(0.7 * twist, True)} {numbers(0.3 * twist, True)}{more})"
        lines.append(f"{time:g}\t{force} {moment}\n")
    (folder / "forces.dat").write_text("".join(lines))
    return folder


@pytest.mark.parametrize("porous", [False, True])
@pytest.mark.parametrize("made", ["brackets", "columns", "org"])
def test_formats_are_told_by_header_and_columns(tmp_path: Path, made: str, porous: bool) -> None:
    """Also where the last line is cut short, as of a run that goes on."""
    folder, is_org = tmp_path / "forces" / "0", made == "org"
    if is_org:
        of_org(folder, porous)
    else:
        of_com(folder, bracket=made == "brackets", porous=porous)
    for path in folder.iterdir():
        path.write_text(path.read_text() + "6.1 (1.0 0.")
    file = folder / ("forces.dat" if is_org else "force.dat")
    for path in (tmp_path / "forces", folder, file):
        forces = read_forces(path)
        assert forces.times == pytest.approx(TIMES)
        assert forces.forces == pytest.approx(PUSH, abs=1e-9)
        assert forces.moments == pytest.approx(TWIST, abs=1e-9)
        assert forces.centre.tolist() == [4.5, 0.5, 0.0]


def test_a_later_start_replaces_what_the_earlier_has_from_there_on(tmp_path: Path) -> None:
    """Ordered by number, not by letters: "10" comes after "2.5", whose samples end before it."""
    of_com(tmp_path / "0", rows=slice(0, 40), factor=0.1)
    of_com(tmp_path / "2.5", rows=slice(25, 60))
    of_com(tmp_path / "10", rows=slice(55, 60))
    forces = read_forces(tmp_path)
    assert forces.times == pytest.approx(TIMES)
    assert forces.forces[:25] == pytest.approx(0.1 * PUSH[:25], abs=1e-9)
    assert forces.forces[25:] == pytest.approx(PUSH[25:], abs=1e-9)


def test_a_rerun_in_the_same_folder_supersedes_the_first(tmp_path: Path) -> None:
    """OpenFOAM adds the start to the name where the folder has a file (`writeFile::newFileAtTime`)."""
    of_com(tmp_path / "0", factor=0.1)
    of_com(tmp_path / "0", "_0", slice(0, 50))
    forces = read_forces(tmp_path)
    assert forces.times == pytest.approx(TIMES[:50])
    assert forces.forces == pytest.approx(PUSH[:50], abs=1e-9)
    assert forces.sources == ("0/force_0.dat 0.1 to 5", "0/force.dat superseded")
    first, second = (read_forces(tmp_path / "0" / f"force{name}.dat") for name in ("", "_0"))
    assert first.forces == pytest.approx(0.1 * PUSH, abs=1e-9)
    assert second.moments == pytest.approx(TWIST[:50], abs=1e-9)


def test_a_run_resumed_in_the_same_folder_goes_on_from_its_start(tmp_path: Path) -> None:
    of_com(tmp_path / "0", "", slice(0, 45), 0.1)
    of_com(tmp_path / "0", "_3", slice(30, 60))
    for path in (tmp_path, tmp_path / "0"):
        forces = read_forces(path)
        assert forces.times == pytest.approx(TIMES)
        assert forces.forces == pytest.approx(np.vstack([0.1 * PUSH[:30], PUSH[30:]]), abs=1e-9)
        assert [source[-8:] for source in forces.sources] == ["0.1 to 3", "3.1 to 6"]


@pytest.mark.parametrize(
    ("files", "said"),
    [
        # Was 3 resumed from the first run, or from that which was started again?
        ([("0", ""), ("0", "_0"), ("3", "")], "0/force_0.dat and 3/force.dat"),
        ([("3", ""), ("3.0", "")], "3/force.dat and 3.0/force.dat"),
        ([("", ""), ("0", "")], "force.dat and 0/force.dat"),
    ],
)
def test_a_folder_that_can_be_read_in_two_ways_is_refused(
    tmp_path: Path, files: list[tuple[str, str]], said: str
) -> None:
    for folder, name in files:
        of_com(tmp_path / folder, name)
    assert said in message(lambda: read_forces(tmp_path))


def test_files_of_two_programs_in_a_folder_are_refused(tmp_path: Path) -> None:
    of_org(of_com(tmp_path))
    assert "force.dat and forces.dat" in message(lambda: read_forces(tmp_path))


def test_moments_about_two_points_are_refused_if_both_count(tmp_path: Path) -> None:
    of_com(tmp_path / "0", rows=slice(0, 30))
    of_com(tmp_path / "0", "_0", slice(0, 30))
    changed(tmp_path / "0" / "moment.dat", "(4.5 ", "(4.4 ")
    assert read_forces(tmp_path).centre.tolist() == [4.5, 0.5, 0.0]
    of_com(tmp_path / "3", rows=slice(30, 60))
    changed(tmp_path / "3" / "moment.dat", "(4.5 ", "(4.6 ")
    said = message(lambda: read_forces(tmp_path))
    assert "0/force_0.dat and 3/force.dat" in said and "have moments about" in said


def changed(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def both(change: Callable[[Path], Any]) -> Callable[[Path, Path], Any]:
    return lambda force, moment: (change(force), change(moment))


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (
            lambda f, m: changed(f, "\n0.1\t1.2", "\n0.1\t1.3"),
            "the total at time 0.1 is not the sum",
        ),
        (lambda f, m: changed(m, CENTRE, ""), "add a line '# CofR"),
        (lambda f, m: m.unlink(), "moment.dat is missing; write moments also"),
        (lambda f, m: changed(m, "\n0.1\t", "\n0.15\t"), "has other times than force.dat"),
        (lambda f, m: f.write_text("0.1" + 9 * " nan" + "\n"), "is not finite at time 0.1"),
        (lambda f, m: f.write_text("hello\n"), "cannot be read"),
        (lambda f, m: f.write_text("1 2 3\n"), "has 3 numbers a line; force.dat has 10"),
        (lambda f, m: f.unlink(), "moment.dat has no file of forces next to it"),
        (lambda f, m: f.write_text(CENTRE), "force.dat has no samples yet"),
        (both(lambda path: changed(path, "\n0.2\t", "\n0.1\t")), "time 0.1 twice or out of order"),
        (lambda f, m: m.write_text(m.read_text() + "# CofR : (0 0 0)\n"), "about 2 points (CofR)"),
        (lambda f, m: changed(m, "(4.5 ", "(1e999 "), "does not name the point of its moments"),
        (both(Path.unlink), "holds no forces; give a folder"),
    ],
)
def test_what_is_wrong_in_files_is_said_in_one_line(
    tmp_path: Path, spoil: Callable[[Path, Path], Any], said: str
) -> None:
    folder = of_com(tmp_path / "0")
    spoil(folder / "force.dat", folder / "moment.dat")
    complaint = message(lambda: read_forces(tmp_path))
    assert said in complaint and "\n" not in complaint


def test_error_of_a_mean_is_that_of_its_batches() -> None:
    """An AR(1) process of variance one and correlation r: the variance of its mean is (1 + r)/((1 - r) n)."""
    random, r, n, estimates = np.random.default_rng(5), 0.8, 4000, []
    for _ in range(100):
        noise = random.standard_normal(n) * np.sqrt(1.0 - r**2)
        values, _ = lfilter([1.0], [1.0, -r], noise, zi=[r * random.standard_normal()])
        estimates.append(mean_in_time(values, np.arange(n, dtype=float)))
    means, errors = np.transpose(estimates)
    exact = np.sqrt((1.0 + r) / ((1.0 - r) * n))
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(exact, rel=0.1)
    assert np.std(means) == pytest.approx(exact, rel=0.2)


# As of case.toml: a mass of 1.65 and a weight less buoyancy of 6 for a volume of one.
SET = ["body.density=1.65", "fluid.density=1", f"gravity.acceleration={6 / 0.65}"]
SET += ["contact.friction=0.5", "errors.samples=10"]
DOWN = "gravity.direction=[0, -1, 0]"
BOX = ("body.shape=box", "body.sides=[1, 1, 1]", "body.centre=[4.5, 0.5, 0.5]")
FLAT = Path("flat")


def in_place(
    *overrides: str, grain: Path | None = BLOCK / "block.stl", bed: Path = BLOCK / "bed.stl"
) -> Case:
    return grain_in_place(grain, bed, [*SET, DOWN, *overrides])


def verdict(case: Case, forces: ForcesInTime | None = None, density: float = 1.0) -> JudgedForces:
    return judge_forces(case, forces or read_forces(FORCES), density, 5.0)


def factor(judged: JudgedForces) -> float:
    return float(judged.judgement["verdict"]["safety_factor"])


@pytest.fixture
def block() -> Case:
    """The case of the demo."""
    return load_case_without_flow(BLOCK / "case.toml", ["errors.samples=10"])


def test_the_block_tips_or_slides_as_statics_say(block: Case) -> None:
    """It slides from F = mu (W - L) on, and tips about its downstream edge from the moment about that on."""
    forces = read_forces(FORCES)
    late = forces.times >= 5.0
    drag, lift, couple = (
        mean_in_time(values[late], forces.times[late])[0]
        for values in (*forces.forces.T[:2], forces.moments[:, 2])
    )
    weight, friction = 6.0, 0.5
    slides = friction * weight / (drag + friction * lift)
    # Moments about (5, 0): the drag at height 1/2 and the couple turn it downstream, lift and weight have arms of 1/2.
    tips = 0.5 * weight / (0.5 * drag + 0.5 * lift - couple)
    assert factor(verdict(block)) == pytest.approx(min(slides, tips), rel=1e-6)
    # Twice the density: twice the load.
    twice = factor(verdict(block, density=2.0))
    assert factor(verdict(block)) == pytest.approx(2.0 * twice, rel=1e-9)


@pytest.mark.parametrize("where", ["case", "in place"])
def test_the_point_of_the_moments_does_not_change_the_verdict(where: str, block: Case) -> None:
    """M_a = M_b + (b - a) ^ F, Varignon's theorem."""
    case, forces = block if where == "case" else in_place(), read_forces(FORCES)
    shift = np.array([-3.0, 2.0, 0.7 if where == "in place" else 0.0])
    moments = forces.moments - np.cross(shift, forces.forces)
    moved = ForcesInTime(forces.times, forces.forces, moments, forces.centre + shift)
    plain, other = verdict(case, forces), verdict(case, moved)
    assert factor(plain) == pytest.approx(factor(other), rel=1e-9)
    assert plain.series.batch.factors == pytest.approx(other.series.batch.factors, rel=1e-9)
    assert plain.series.batch.mode_names == other.series.batch.mode_names


def test_too_few_samples_are_told_as_those_of_the_mean(block: Case) -> None:
    forces = read_forces(FORCES)
    short = forces.only(np.arange(len(forces.times)) < 50)
    with pytest.raises(SceneError, match=r"^--forces: the mean has 25 samples from time"):
        judge_forces(block, short, 1.0, None)


@pytest.mark.parametrize("how", ["files", "box on a plane"])
def test_the_shipped_block_is_judged_as_by_its_case(how: str, block: Case) -> None:
    """Contacts, weight and inertia from the surfaces give the verdict of those in case.toml."""
    case = in_place() if how == "files" else in_place(*BOX, grain=None, bed=FLAT)
    mine, theirs = verdict(case), verdict(block)
    assert factor(mine) == pytest.approx(factor(theirs), rel=1e-6)
    assert mine.series.batch.factors == pytest.approx(theirs.series.batch.factors, rel=1e-6)
    assert mine.series.batch.mode_names == theirs.series.batch.mode_names
    assert case.grain is not None and case.grain.mass == pytest.approx(1.65)
    assert np.array(case.grain.inertia) == pytest.approx(0.275 * np.eye(3), abs=1e-12)


def test_a_turned_frame_changes_nothing(tmp_path: Path) -> None:
    """The run, its grain and bed turned together, gravity with them."""
    turn = trimesh.transformations.random_rotation_matrix(np.array([0.1, 0.6, 0.3]))
    for name in ("block", "bed"):
        surface = trimesh.load(BLOCK / f"{name}.stl")
        surface.apply_transform(turn).export(tmp_path / f"{name}.stl")
    matrix, forces = turn[:3, :3], read_forces(FORCES)
    vectors = (forces.forces @ matrix.T, forces.moments @ matrix.T, matrix @ forces.centre)
    down = f"gravity.direction={(-matrix[:, 1]).tolist()}"
    # STL holds single precision.
    changes = [*SET, down, "contact.tolerance=1e-4"]
    case = grain_in_place(tmp_path / "block.stl", tmp_path / "bed.stl", changes)
    turned = verdict(case, ForcesInTime(forces.times, *vectors))
    assert factor(turned) == pytest.approx(factor(verdict(in_place())), rel=1e-5)


def test_a_sphere_on_three_in_place(tmp_path: Path) -> None:
    """Three of radius one in a triangle, one upon them: contacts at 1/sqrt 3 of the radius off the axis."""
    angles, side = np.radians([0, 120, 240]), np.linspace(-1.2, 1.2, 121)
    x, y = np.meshgrid(side, side)
    squares = [
        (x - np.cos(angle) * 2.0 / np.sqrt(3.0)) ** 2
        + (y - np.sin(angle) * 2.0 / np.sqrt(3.0)) ** 2
        for angle in angles
    ]
    heights = np.sqrt(np.maximum(1.0 - np.min(squares, axis=0), 0.0))
    first = (np.arange(120)[:, None] * 121 + np.arange(120)).ravel()
    triangles = np.vstack(
        [np.stack([first, first + one, first + other], 1) for one, other in ((1, 122), (122, 121))]
    )
    points = np.stack([x, y, heights], axis=2).reshape(-1, 3)
    trimesh.Trimesh(points, triangles, process=False).export(tmp_path / "bed.ply")
    centre = f"body.centre=[0, 0, {np.sqrt(4.0 - 4.0 / 3.0)}]"
    sphere = ["body.shape=sphere", "body.diameter=2", centre]
    changes = [*SET, *sphere, "contact.tolerance=1e-3", "bed.cell=[0.02, 0.02]"]
    points = grain_in_place(None, tmp_path / "bed.ply", changes).to_contacts().points
    away = np.hypot(points[:, 0], points[:, 1])
    assert away == pytest.approx(np.full(3, 1.0 / np.sqrt(3.0)), abs=1e-2)


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
    assert factor(verdict(case)) == pytest.approx(factor(verdict(in_place())), rel=1e-6)
    for folder in (tmp_path, BLOCK):
        scene = loads(IN_SCENE, folder)
        assert scene.grain is not None and scene.placement is not None
        assert scene.placement.centre == pytest.approx((5.0, 5.0, 0.5), abs=1e-7)
        assert scene.grain.volume == pytest.approx(1.0, abs=1e-7)


GRAIN, BED = BLOCK / "block.stl", BLOCK / "bed.stl"


@pytest.mark.parametrize(
    ("overrides", "grain", "bed", "said"),
    [
        ([], None, FLAT, "--grain is missing"),
        ([], GRAIN, None, "--bed is missing"),
        (SET[1:], GRAIN, FLAT, "body: has no mass; give body.density"),
        (SET[:1] + SET[2:], GRAIN, FLAT, "by --set): fluid.density: is missing; add it"),
        (SET, GRAIN, BED, "upwards is against gravity.direction"),
        ([*SET, "gravity.direction=[0, 0, 0]"], GRAIN, FLAT, "direction: is zero"),
        ([*SET, DOWN, "bed.height=-0.1"], GRAIN, FLAT, "of its size above the bed"),
        ([*SET, DOWN, "bed.height=1"], GRAIN, BED, "leave it out"),
        # The block is 1 high: its centre is 0.3 above, or 0.1 below, a plane that it stands in.
        ([*SET, DOWN, "bed.height=0.2"], GRAIN, FLAT, "in the bed, by 0.115"),
        ([*SET, DOWN, "bed.height=0.6"], GRAIN, FLAT, "is below the bed"),
        ([*SET, DOWN, "bed.height=9"], GRAIN, FLAT, "is below the bed"),
        # Seen against a gravity of the wrong sign the bed is above the block.
        (
            [*SET, "gravity.direction=[0, 1, 0]"],
            GRAIN,
            BED,
            "below the bed; reverse gravity.direction",
        ),
        (SET, BED, FLAT, "bed.stl"),
        (SET, BLOCK / "absent.stl", FLAT, "absent.stl"),
        ([*SET, *BOX[:2]], None, FLAT, "neither x nor centre is given"),
    ],
)
def test_what_is_wrong_of_a_grain_in_place_is_said(
    overrides: list[str], grain: Path | None, bed: Path | None, said: str
) -> None:
    assert said in message(lambda: grain_in_place(grain, bed, overrides))


def test_motion_in_time_of_a_pulsating_force() -> None:
    """A drag of 2 + cos(2 pi t) on a block that slides from 2.5 on: a third of each period, once in each."""
    times = np.linspace(0.0, 20.0, 8_001)
    forces = (2.0 + np.cos(2.0 * np.pi * times))[:, None] * [1.0, 0.0, 0.0]
    pulsating = ForcesInTime(times, forces, 0.0 * forces, np.array([4.5, 0.5, 0.5]))
    case = in_place("contact.friction=0.416666666666666667", *BOX, grain=None, bed=FLAT)
    for law, power in (("U", 1.0), ("U2", 2.0)):
        judged = judge_forces(case, pulsating, 1.0, 0.0, law)
        motion, threshold = judged.series.motion, judged.threshold
        assert motion.probability == pytest.approx(1.0 / 3.0, abs=2e-3)
        assert motion.error is not None and motion.error < 0.02
        assert motion.rate == pytest.approx(1.0, rel=1e-9) and motion.low < 1.0 < motion.high
        assert threshold is not None and threshold.mean is not None
        assert threshold.mean[0] ** power == pytest.approx(2.5 / 2.0, rel=1e-3)
        for one in threshold.quantiles:
            # The drag is above 2 + cos(pi p) for a fraction p of the time.
            exact = 2.5 / (2.0 + np.cos(np.pi * one.probability))
            assert one.factor**power == pytest.approx(exact, rel=2e-3)
            assert one.low <= one.factor <= one.high


def test_a_series_that_never_moves() -> None:
    """No event in a time T: the rate is below 3/T with 95%, by Poisson's law."""
    times = np.arange(50.0)
    names = ("force_y", "force_z", "couple_x", "couple_y", "couple_z")
    columns = {"time": times, "force_x": 0.0 * times + 0.1, **dict.fromkeys(names, 0.0 * times)}
    motion = judge_series(in_place(*BOX, grain=None, bed=FLAT), columns).motion
    assert (motion.probability, motion.error, motion.rate, motion.low) == (0.0, None, 0.0, 0.0)
    assert motion.high == pytest.approx(3.0 / 49.0)


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
        (["--since", "1"], "--since: needs --forces or --series"),
        (["--law", "U"], "--law: needs --forces or --series"),
        (["--jobs", "1"], "--jobs: needs --batch"),
        (["--density", "1"], "--density: needs --forces"),
        (["--grain", "a.stl"], "--grain: needs --forces"),
        (["--bed", "flat"], "--bed: needs --forces"),
        (["--forces", str(FORCES)], "--forces: needs --density"),
        (["--forces", str(FORCES), "--density", "-1"], "--density: is -1"),
        (["--forces", str(FORCES), "--density", "1", "--bed", "flat"], "leave one of them out"),
        (["--forces", str(FORCES), "--density", "1", "--since", "9.9"], "3 samples from time 9.9"),
    ],
)
def test_wrong_options_are_refused(words: list[str], needs: str, capsys: Any) -> None:
    assert main(["judge", str(BLOCK / "case.toml"), *words]) == 2
    assert needs in capsys.readouterr().err


@pytest.mark.parametrize("how", ["case", "in place"])
def test_the_command(how: str, tmp_path: Path, capsys: Any) -> None:
    order = ["judge", "--forces", str(FORCES), "--density", "1", "--law", "U2"]
    order += ["--out", str(tmp_path / "out")]
    if how == "case":
        order += [str(BLOCK / "case.toml"), "--since", "6"]
    else:
        order += ["--grain", str(GRAIN), "--bed", str(BED)]
        order += [word for one in (*SET, DOWN) for word in ("--set", one)]
    assert main(order) == 0
    said = capsys.readouterr().out
    if how == "case":
        assert "mean from time 6 on" in said and "A block on a bed, forces of OpenFOAM\n" in said
    else:
        assert "probability at an instant 0, 100 samples" in said
    for name in ("judgement.json", "series.csv", "series.json", "judgement.png", "series.png"):
        assert (tmp_path / "out" / name).is_file()
    stored = json.loads((tmp_path / "out" / "judgement.json").read_text())
    root = np.sqrt(stored["verdict"]["safety_factor"])
    assert stored["threshold"]["mean"][0] == pytest.approx(root, rel=1e-12)
    assert len(stored["case"]["contacts"]["points"]) == (2 if how == "case" else 4)
    assert [source[:12] for source in stored["forces"]] == ["0/force.dat ", "5/force.dat "]


def test_a_series_is_taken_from_a_time_on(tmp_path: Path, capsys: Any) -> None:
    """A push of 4 at first and of 0.5 from time 2 on; friction holds 3."""
    series = tmp_path / "series.csv"
    rows = [f"{t},{4 if t < 2 else 0.5},0,0" for t in range(5)]
    series.write_text("\n".join(["time,force_x,force_y,couple", *rows]) + "\n")
    order = ["judge", str(BLOCK / "case.toml"), "--series", str(series), "--law", "U"]
    for since, least in ((None, 3.0 / 4.0), ("2", 3.0 / 0.5)):
        more = [] if since is None else ["--since", since]
        assert main([*order, *more, "--out", str(tmp_path / "out")]) == 0
        stored = json.loads((tmp_path / "out" / "series.json").read_text())
        assert stored["least_safety_factor"] == pytest.approx(least)
    said = capsys.readouterr().out
    assert "rest                100.000% of the time" in said and "from time 2 on" in said
    assert main([*order, "--since", "5"]) == 2
    assert "there are no samples from 5 on; the last time is 4" in capsys.readouterr().err
