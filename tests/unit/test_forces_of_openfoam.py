"""Forces as OpenFOAM writes them: formats, starts, means with their errors, and the verdict on them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from incipient.cli import main
from incipient.errors import SceneError
from incipient.judging.case import load_case_without_flow
from incipient.judging.forces import judge_forces
from incipient.judging.motion import mean_in_time
from incipient.judging.openfoam import ForcesInTime, read_forces

BLOCK = Path(__file__).parents[2] / "demos" / "cases" / "openfoam_block"
TIMES = np.arange(1, 61) * 0.1
PRESSURE = np.column_stack([1.0 + 0.1 * np.sin(9.0 * TIMES), 0.3 + 0.0 * TIMES, 0.0 * TIMES])
VISCOUS = np.column_stack([0.2 + 0.0 * TIMES, 0.05 * np.cos(7.0 * TIMES), 0.0 * TIMES])
PUSH = PRESSURE + VISCOUS
TWIST = np.column_stack([0.0 * TIMES, 0.0 * TIMES, -0.1 + 0.02 * np.sin(5.0 * TIMES)])
CENTRE = "# CofR          : (4.5 0.5 0)\n"


def vector(values: np.ndarray, bracket: bool) -> str:
    text = " ".join(f"{one:.10e}" for one in values)
    return f"({text})" if bracket else text


def of_com(folder: Path, bracket: bool, rows: slice = slice(None), porous: bool = False) -> Path:
    """`force.dat` and `moment.dat`, with vectors in brackets as up to 2012 or in columns as later."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, parts in (
        ("force.dat", (PRESSURE, VISCOUS)),
        ("moment.dat", (0.7 * TWIST, 0.3 * TWIST)),
    ):
        parts = (*parts, 0.0 * PRESSURE) if porous else parts
        columns = (sum(parts), *parts)
        lines = [
            "\t".join([f"{time:g}", *(vector(one, bracket) for one in at)])
            for time, *at in zip(TIMES[rows], *(one[rows] for one in columns), strict=True)
        ]
        head = (
            f"# {name}\n{CENTRE}# Time total_x total_y total_z pressure_x pressure_y pressure_z\n"
        )
        (folder / name).write_text(head + "\n".join(lines) + "\n")
    return folder


def of_org(folder: Path, porous: bool = False) -> Path:
    """`forces.dat` with both, as openfoam.org and foam-extend write it."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = []
    for time, pressure, viscous, twist in zip(TIMES, PRESSURE, VISCOUS, TWIST, strict=True):
        more = f" {vector(0.0 * twist, True)}" if porous else ""
        force = f"({vector(pressure, True)} {vector(viscous, True)}{more})"
        moment = f"({vector(0.7 * twist, True)} {vector(0.3 * twist, True)}{more})"
        lines.append(f"{time:g}\t{force} {moment}")
    head = f"# Forces\n{CENTRE}# Time  \tforces(pressure viscous) moment(pressure viscous)\n"
    (folder / "forces.dat").write_text(head + "\n".join(lines) + "\n")
    return folder


@pytest.mark.parametrize("porous", [False, True])
@pytest.mark.parametrize("made", ["brackets", "columns", "org"])
def test_formats_are_told_by_header_and_columns(tmp_path: Path, made: str, porous: bool) -> None:
    folder = tmp_path / "forces" / "0"
    folder = (
        of_org(folder, porous)
        if made == "org"
        else of_com(folder, made == "brackets", porous=porous)
    )
    for path in (
        tmp_path / "forces",
        folder,
        folder / ("forces.dat" if made == "org" else "force.dat"),
    ):
        found = read_forces(path)
        assert found.times == pytest.approx(TIMES)
        assert found.forces == pytest.approx(PUSH, abs=1e-9)
        assert found.moments == pytest.approx(TWIST, abs=1e-9)
        assert found.centre.tolist() == [4.5, 0.5, 0.0]


def test_a_later_start_replaces_what_the_earlier_has_from_there_on(tmp_path: Path) -> None:
    of_com(tmp_path / "0", True, slice(0, 40))
    later = of_com(tmp_path / "2.5", True, slice(25, 60))
    text = (later / "force.dat").read_text().replace("(1.", "(1.")
    (later / "force.dat").write_text(text)
    of_com(tmp_path / "10", True, slice(55, 60))
    found = read_forces(tmp_path)
    assert found.times == pytest.approx(TIMES) and found.forces == pytest.approx(PUSH, abs=1e-9)
    # Ordered by number, not by letters: "10" comes after "2.5".
    assert (np.diff(found.times) > 0.0).all()


def restarted(folder: Path, name: str, rows: slice, factor: float = 1.0) -> None:
    """`force_NAME.dat` and `moment_NAME.dat`, all numbers but the times multiplied by a factor."""
    apart = of_com(folder / "apart", False, rows)
    folder.mkdir(exist_ok=True)
    for kind in ("force", "moment"):
        lines = []
        for line in (apart / f"{kind}.dat").read_text().splitlines():
            time, *numbers = line.split()
            scaled = (
                [time, *(f"{factor * float(one):.10e}" for one in numbers)]
                if time != "#"
                else [line]
            )
            lines.append(" ".join(scaled))
        (folder / f"{kind}{name}.dat").write_text("\n".join(lines) + "\n")
        (apart / f"{kind}.dat").unlink()
    apart.rmdir()


def test_a_rerun_in_the_same_folder_supersedes_the_first(tmp_path: Path) -> None:
    """OpenFOAM adds the start to the name where the folder has a file (`writeFile::newFileAtTime`)."""
    restarted(tmp_path / "0", "", slice(0, 60), 0.1)
    restarted(tmp_path / "0", "_0", slice(0, 50))
    found = read_forces(tmp_path)
    assert found.times == pytest.approx(TIMES[:50])
    assert found.forces == pytest.approx(PUSH[:50], abs=1e-9)
    assert found.sources == ("0/force_0.dat 0.1 to 5", "0/force.dat superseded")
    only = read_forces(tmp_path / "0" / "force.dat")
    assert only.forces == pytest.approx(0.1 * PUSH, abs=1e-9)
    assert read_forces(tmp_path / "0" / "force_0.dat").moments == pytest.approx(
        TWIST[:50], abs=1e-9
    )


def test_a_run_resumed_in_the_same_folder_goes_on_from_its_start(tmp_path: Path) -> None:
    restarted(tmp_path / "0", "", slice(0, 45), 0.1)
    restarted(tmp_path / "0", "_3", slice(30, 60))
    for path in (tmp_path, tmp_path / "0"):
        found = read_forces(path)
        assert found.times == pytest.approx(TIMES)
        assert found.forces[:30] == pytest.approx(0.1 * PUSH[:30], abs=1e-9)
        assert found.forces[30:] == pytest.approx(PUSH[30:], abs=1e-9)
        assert [one[-8:] for one in found.sources] == ["0.1 to 3", "3.1 to 6"]


@pytest.mark.parametrize(
    ("files", "said"),
    [
        # Was 3 resumed from the first run, or from that which was started again?
        (
            [("0", "", 0, 40), ("0", "_0", 0, 40), ("3", "", 30, 60)],
            "0/force_0.dat and 3/force.dat",
        ),
        ([("3", "", 30, 60), ("3.0", "", 30, 60)], "3/force.dat and 3.0/force.dat"),
        ([("", "", 0, 60), ("0", "", 0, 60)], "force.dat and 0/force.dat"),
    ],
)
def test_a_folder_that_can_be_read_in_two_ways_is_refused(
    tmp_path: Path, files: list[tuple[str, str, int, int]], said: str
) -> None:
    for folder, name, first, last in files:
        restarted(tmp_path / folder, name, slice(first, last))
    with pytest.raises(SceneError, match=said):
        read_forces(tmp_path)


def test_files_of_two_programs_in_a_folder_are_refused(tmp_path: Path) -> None:
    of_org(of_com(tmp_path, True))
    with pytest.raises(SceneError, match=r"force\.dat and forces\.dat"):
        read_forces(tmp_path)


def test_moments_about_two_points_are_refused_if_both_count(tmp_path: Path) -> None:
    restarted(tmp_path / "0", "", slice(0, 30))
    restarted(tmp_path / "0", "_0", slice(0, 30))
    changed(tmp_path / "0" / "moment.dat", "(4.5 ", "(4.4 ")
    assert read_forces(tmp_path).centre.tolist() == [4.5, 0.5, 0.0]
    restarted(tmp_path / "3", "", slice(30, 60))
    changed(tmp_path / "3" / "moment.dat", "(4.5 ", "(4.6 ")
    with pytest.raises(SceneError, match=r"0/force_0\.dat and 3/force\.dat .* have moments about"):
        read_forces(tmp_path)


def changed(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def test_a_line_that_was_cut_short_is_left_out(tmp_path: Path) -> None:
    folder = of_com(tmp_path, True)
    for name in ("force.dat", "moment.dat"):
        with (folder / name).open("a") as file:
            file.write("6.1 (1.0 0.")
    assert read_forces(folder).times == pytest.approx(TIMES)


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ("total", r"force\.dat: the total at time 0\.1 is not the sum of its parts"),
        ("centre", r"does not say what point its moments are about; add a line '# CofR"),
        ("moments", r"moment\.dat is missing; write moments also"),
        ("times", "has other times than force.dat"),
        ("nan", r"is not finite at time 0\.1; take such lines out"),
        ("words", "cannot be read"),
        ("nothing", "holds no forces; give a folder"),
        ("moments alone", r"moment\.dat has no file of forces beside it"),
        ("header", r"force\.dat has no samples yet"),
        ("twice", r"force\.dat has time 0\.1 twice or out of order"),
        ("points", r"moment\.dat has moments about 2 points \(CofR\)"),
        ("not finite point", "does not say what point its moments are about"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path: Path, broken: str, said: str) -> None:
    folder = of_com(tmp_path / "0", True)
    force, moment = folder / "force.dat", folder / "moment.dat"
    first = force.read_text().splitlines()[3]
    if broken == "total":
        changed(force, first, first.replace("(1.2", "(1.3", 1).replace("(1.7", "(1.8", 1))
    elif broken == "centre":
        changed(moment, CENTRE, "")
    elif broken == "moments":
        moment.unlink()
    elif broken == "times":
        changed(moment, "0.1\t", "0.15\t")
    elif broken == "nan":
        changed(force, first, "0.1 " + " ".join(["(nan nan nan)"] * 3))
    elif broken == "words":
        force.write_text("hello\n")
    elif broken == "moments alone":
        force.unlink()
    elif broken == "header":
        force.write_text(CENTRE)
    elif broken == "twice":
        for path in (force, moment):
            changed(path, "\n0.2\t", "\n0.1\t")
    elif broken == "points":
        with moment.open("a") as file:
            file.write("# CofR : (0 0 0)\n")
    elif broken == "not finite point":
        changed(moment, "(4.5 ", "(1e999 ")
    else:
        force.unlink()
        moment.unlink()
    with pytest.raises(SceneError, match=said) as error:
        read_forces(tmp_path)
    assert "\n" not in str(error.value)


def test_error_of_a_mean_is_that_of_its_batches() -> None:
    # An AR(1) process of variance one and correlation r: the variance of its mean is (1 + r)/((1 - r) n).
    random, r, n, errors, means = np.random.default_rng(5), 0.8, 4000, [], []
    for _ in range(100):
        noise = random.standard_normal(n) * np.sqrt(1.0 - r**2)
        values, _ = lfilter([1.0], [1.0, -r], noise, zi=[r * random.standard_normal()])
        mean, error = mean_in_time(values, np.arange(n, dtype=float))
        means.append(mean)
        errors.append(error)
    exact = np.sqrt((1.0 + r) / ((1.0 - r) * n))
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(exact, rel=0.1)
    assert np.std(means) == pytest.approx(exact, rel=0.2)


def test_the_point_of_the_moments_does_not_change_the_verdict() -> None:
    case = load_case_without_flow(BLOCK / "case.toml", [])
    found = read_forces(BLOCK / "postProcessing" / "forces")
    shift = np.array([-3.0, 2.0, 0.0])
    moved = ForcesInTime(
        found.times,
        found.forces,
        found.moments - np.cross(shift, found.forces),
        found.centre + shift,
    )
    plain, other = (judge_forces(case, one, 1.0, 5.0) for one in (found, moved))
    factors = [one.judgement["verdict"]["safety_factor"] for one in (plain, other)]
    assert factors[0] == pytest.approx(factors[1], rel=1e-9)
    assert plain.series.batch.factors == pytest.approx(other.series.batch.factors, rel=1e-9)


def test_density_multiplies_the_load() -> None:
    case = load_case_without_flow(BLOCK / "case.toml", [])
    found = read_forces(BLOCK / "postProcessing" / "forces")
    once, twice = (judge_forces(case, found, density, 5.0) for density in (1.0, 2.0))
    factors = [one.judgement["verdict"]["safety_factor"] for one in (once, twice)]
    assert factors[0] == pytest.approx(2.0 * factors[1], rel=1e-9)


def test_the_block_tips_or_slides_as_statics_say() -> None:
    """It slides from F = mu (W - L) on, and tips about its downstream edge from the moment about that on."""
    case = load_case_without_flow(BLOCK / "case.toml", [])
    found = read_forces(BLOCK / "postProcessing" / "forces")
    late = found.times >= 5.0
    drag, lift, couple = (
        mean_in_time(values[late], found.times[late])[0]
        for values in (*found.forces.T[:2], found.moments[:, 2])
    )
    weight, friction = 6.0, 0.5
    slides = friction * weight / (drag + friction * lift)
    # Moments about (5, 0): the drag at height 1/2 and the couple turn it downstream, lift and weight have arms of 1/2.
    tips = 0.5 * weight / (0.5 * drag + 0.5 * lift - couple)
    judged = judge_forces(case, found, 1.0, 5.0).judgement["verdict"]["safety_factor"]
    assert judged == pytest.approx(min(slides, tips), rel=1e-6)


def test_too_few_samples_are_told_as_those_of_the_mean() -> None:
    found = read_forces(BLOCK / "postProcessing" / "forces")
    short = found.only(np.arange(len(found.times)) < 50)
    case = load_case_without_flow(BLOCK / "case.toml", [])
    with pytest.raises(SceneError, match=r"^--forces: the mean would be of 25 samples from time"):
        judge_forces(case, short, 1.0, None)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "judge",
        str(BLOCK / "case.toml"),
        "--forces",
        str(BLOCK / "postProcessing" / "forces"),
    ]
    assert main([*words, "--density", "1", "--since", "6", "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "mean from time 6 on" in said and "A block on a bed, forces of OpenFOAM\n" in said
    for name in ("judgement.json", "series.csv", "series.json", "judgement.png", "series.png"):
        assert (tmp_path / "out" / name).is_file()
    for more, why in (
        ([], "--forces needs --density"),
        (["--density", "-1"], "--density: is -1"),
        (["--density", "1", "--since", "99"], "--since: nothing is there from 99 on"),
        (["--density", "1", "--since", "9.9"], "3 samples from time 9.9 on, and takes 40 or more"),
    ):
        assert main([*words, *more]) not in (0, 70)
        assert why in capsys.readouterr().err
