"""The command line, and what scenes in other units and of other shapes give."""

from __future__ import annotations

import json
import os
import pty
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from environment import environment, finished
from mpi4py import MPI
from numpy.typing import NDArray
from processes import (
    CAVITY,
    CYLINDER,
    GRAIN_ON_BED,
    has_control_characters,
    result_of,
    settings,
)
from scenes import message, on_bed

import incipient
from incipient.cli import main
from incipient.errors import ConvergenceError
from incipient.files import MARK
from incipient.mesh.sampling import sample
from incipient.results.result import Result
from incipient.scene import Scene
from incipient.scene.file import load, loads
from incipient.thresholds.critical import find_threshold

# The command as a user meets it: what it says, where it puts things, and how it refuses bad input.


BLOCK_ON_INCLINE = CAVITY.parents[1] / "cases" / "block_on_incline.toml"
ACCURATE = settings(numerics_accuracy=0.01)
IN_TIME = ["--set", "time={end=10.0, step=0.1, start='steady'}"]
COARSE = settings(numerics_mesh_size=4, numerics_order=2, numerics_error_bars=False)


COUNTED = [
    (CAVITY, {"numerics_order": 3}),
    (CYLINDER, {"numerics_order": 4}),
    (CYLINDER, {"numerics_order": 2, "numerics_geometry_order": 1}),
    (GRAIN_ON_BED, {"bed_kind": "half-discs", "bed_radius": 0.5, "bed_spacing": 1.2}),
]


# -- what a run says and leaves ------------------------------------------------------------------------------


def test_run_writes_to_the_named_directory(command, tmp_path):
    done = command("run", GRAIN_ON_BED, *COARSE, "--set", "fluid.reynolds=40", "--out", "deep/down")
    names = {path.name for path in (tmp_path / "deep/down").iterdir()}
    series = {f"{name}{ending}" for name in ("fields", "surface") for ending in ("", ".xdmf")}
    assert names == {MARK, "scene.toml", "result.json", *series}
    assert result_of(tmp_path / "deep/down")["scene"]["fluid"]["reynolds"] == 40
    assert "deep/down/fields.xdmf" in done.stdout and "on 1 rank\n" in done.stderr
    # One page: the verdict, the forces, what was simulated and left out, files and cost; effects in a line each.
    heads = [line.split("  ")[0] for line in done.stdout.splitlines() if line[0] != " "]
    order = ["verdict", "force of the flow", "coefficients", "simulated", "cost", "pictures"]
    assert [head for head in heads if head in order] == order
    assert len(done.stdout.splitlines()) + len(done.stderr.splitlines()) <= 40
    assert "third dimension" not in done.stdout + done.stderr
    assert not has_control_characters(done.stderr + done.stdout)


@pytest.mark.slow
def test_the_levels_of_the_log(command):
    def said(level):
        done = command("run", CAVITY, *COARSE, "--log-level", level)
        assert "minimum of v1" in done.stdout
        return done.stderr

    assert said("warning") == ""
    info, debug = said("info"), said("debug")
    assert (
        "Driven cavity on 1 rank" in info and "stage:" not in info and "Newton update" not in info
    )
    assert "stage: mesh" in debug and "Newton update 1" in debug


def test_pictures_that_fail_take_nothing_with_them(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("incipient.pictures.sys.executable", "/bin/false")
    options = [*COARSE, *settings(output_pictures=True, numerics_error_bars=False)]
    code = main(["run", str(GRAIN_ON_BED), *options, "--out", str(tmp_path)])
    said = capsys.readouterr()
    assert code == 5
    for line in (
        "verdict  ",
        f"verdict and numbers {tmp_path / 'result.json'}",
        "cost  ",
        "pictures  ",
    ):
        assert f"\n{line}" in f"\n{said.out}"
    assert said.err.splitlines()[-1] == (
        "incipient: not drawn: the drawing ended with code 1; the other results are complete, "
        f"draw again with: incipient show {tmp_path}"
    )
    assert result_of(tmp_path)["status"] == "complete"


def test_on_a_terminal_a_line_lives_and_goes(tmp_path):
    keyboard, terminal = pty.openpty()
    arguments = [
        sys.executable,
        "-m",
        "incipient",
        "run",
        str(CAVITY),
        *COARSE,
        "--out",
        str(tmp_path),
    ]
    run = subprocess.Popen(
        arguments, env=environment() | {"TERM": "xterm"}, stderr=terminal, stdout=terminal
    )
    os.close(terminal)
    shown = b""
    while piece := _read(keyboard):
        shown += piece
    os.close(keyboard)
    assert run.wait(timeout=60) == 0
    assert b"\x1b[" in shown and b"minimum of v1" in shown


def _read(terminal):
    try:
        return os.read(terminal, 4096)
    except OSError:  # how Linux says that the other end is closed
        return b""


# -- the other commands --------------------------------------------------------------------------------------


def test_a_new_scene_runs_keeps_dots_in_its_name_and_spares_what_exists(
    tmp_path, monkeypatch, said_by
):
    monkeypatch.chdir(tmp_path)
    assert "incipient run 'two words.toml'" in said_by("new", "two words")
    assert "incipient run re_0.5.toml" in said_by("new", "re_0.5")
    assert main(["run", "re_0.5.toml", *COARSE]) == 0
    (path,) = (tmp_path / "results").iterdir()
    assert path.name == "re_0.5" and result_of(path)["status"] == "complete"
    (tmp_path / "mine.toml").write_text("precious")
    assert "mine.toml: already exists" in said_by("new", "mine.toml", code=2)
    assert (tmp_path / "mine.toml").read_text() == "precious"


@pytest.mark.slow
def test_names_need_not_be_utf_8(tmp_path: Path) -> None:
    directory = tmp_path / os.fsdecode(b"caf\xe9")
    directory.mkdir()
    coarse = settings(numerics_order=2, numerics_mesh_size=6, numerics_error_bars=False)
    for words, name in (
        (["judge", BLOCK_ON_INCLINE, "--out", directory], "judgement.json"),
        (["run", CAVITY, *coarse, "--out", directory], "result.json"),
        (["judge", BLOCK_ON_INCLINE, "--out", "."], "judgement.png"),
    ):
        command = [sys.executable, "-m", "incipient", *words]
        finished(command, 120, env=environment(), cwd=directory, errors="surrogateescape")
        assert (directory / name).exists()


# On several ranks one alone makes a plan: importing PETSc would wait for the others.
FINITE_ELEMENTS = "dolfinx petsc4py ufl h5py pyvista matplotlib"
IMPORTED = """
import sys
from incipient.cli import main
try:
    main(sys.argv[2:])
finally:
    print([name for name in sys.argv[1].split() if name in sys.modules])
"""


@pytest.mark.parametrize(
    ("absent", "arguments", "says"),
    [
        (FINITE_ELEMENTS, ["plan", GRAIN_ON_BED], " no  unsteadiness"),
        (FINITE_ELEMENTS, ["plan", GRAIN_ON_BED, *ACCURATE], "yes  contact"),
        (FINITE_ELEMENTS, ["plan", GRAIN_ON_BED, *ACCURATE, *IN_TIME], "yes  unsteadiness"),
        (
            "pyvista matplotlib vtk rich pkg_resources incipient.contact incipient.coupled.tractions "
            "incipient.output.xdmf incipient.pictures",
            ["run", CAVITY, *COARSE, *settings(output_fields=False)],
            "minimum of v1",
        ),
        # Linear programs and trees of points take a tenth of the time of a small run to import.
        ("scipy.optimize scipy.spatial matplotlib", ["run", CYLINDER, *COARSE], "drag"),
    ],
)
def test_a_command_imports_only_what_it_needs(absent, arguments, says, tmp_path):
    command = [sys.executable, "-c", IMPORTED, absent, *map(str, arguments)]
    done = finished(command, 120, env=environment(), cwd=tmp_path)
    assert says in done.stdout and done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(("scene", "values"), COUNTED)
def test_plan_counts_what_the_run_solves_for(said_by, tmp_path, scene, values):
    changed = [str(scene), *settings(numerics_mesh_size=4, numerics_error_bars=False, **values)]
    planned = json.loads(said_by("plan", *changed, "--json"))
    assert main(["run", *changed, "--out", str(tmp_path / "x")]) == 0
    result = result_of(tmp_path / "x")
    assert planned["estimate"]["unknowns"] == result["cost"]["unknowns"]
    assert planned["estimate"]["cells"] == result["cost"]["cells"]
    assert planned["effects"] == result["plan"]["effects"]


def test_the_installed_command_is_the_module_and_knows_its_version(command):
    installed = Path(sys.executable).with_name("incipient")
    printed = [
        finished([installed, option], 120, env=environment()) for option in ("--help", "--version")
    ]
    assert printed[0].stdout == command("--help").stdout
    assert printed[1].stdout == f"incipient {metadata.version('incipient')}\n"
    for name in ("run", "plan", "show", "new", "schema"):
        assert f"    {name} " in printed[0].stdout


# -- bad input -----------------------------------------------------------------------------------------------


def _changed(scene: Path, old: str, new: str) -> str:
    text = scene.read_text()
    assert old in text
    return text.replace(old, new, 1)


BAD_SCENES = {
    "unknown_key": (
        _changed(GRAIN_ON_BED, "reynolds = 20.0", "reynold = 20.0"),
        'fluid.reynold: unknown key; did you mean "reynolds"?',
    ),
    "negative": (
        _changed(GRAIN_ON_BED, "reynolds = 20.0", "reynolds = -20.0"),
        "fluid.reynolds: is -20.0; give a number greater than 0",
    ),
    "free_surface": (
        _changed(CAVITY, "height = 1.0", 'height = 1.0\ntop = "free-surface"'),
        'domain.top: "free-surface" contradicts the flow "lid"; use "auto" or "wall"',
    ),
    "outside": (
        _changed(GRAIN_ON_BED, "x = 16.0", "x = 26.0"),
        "body.x: x = 26 is outside the domain, 0 to 24; move the grain",
    ),
    "friction": (
        CYLINDER.read_text() + "[contact]\nfriction = 0.5\n",
        "contact.friction: friction needs a bed but there is none; add a section [bed]",
    ),
    "polyline": (
        _changed(GRAIN_ON_BED, 'kind = "flat"', 'kind = "polyline"\nfile = "missing.csv"'),
        "bed.file: missing.csv cannot be read (No such file or directory); give the name of a CSV file",
    ),
    "broken": (_changed(CAVITY, "[fluid]", "[fluid"), "line 9: expected ']'"),
}
BAD_COMMANDS = [
    (
        ["run", "nowhere.toml"],
        2,
        "nowhere.toml: cannot be read (No such file or directory); give the name",
    ),
    (["run", "."], 2, ".: cannot be read (Is a directory); give the name of a scene file"),
    (
        ["run", CAVITY, "--set", "fluid.reynolds"],
        2,
        "--set fluid.reynolds: is not an assignment; write",
    ),
    (
        ["run", CAVITY, "--set", "fluid.reynolds=no"],
        2,
        '--set fluid.reynolds=no: fluid.reynolds: is "no"; give',
    ),
    (["plan", "nowhere.toml"], 2, "nowhere.toml: cannot be read"),
    (
        ["show", "nowhere"],
        2,
        "nowhere: there is no such directory; give the directory that a run was",
    ),
    (
        ["show", "."],
        2,
        ".: is not the directory of a run; give the directory that a run was written to",
    ),
    (["show", "no.toml"], 2, "no.toml: there is no such directory; give the directory"),
    (
        ["show", CAVITY],
        2,
        "is a scene, not results; run it, then give the directory of the results",
    ),
    (["new", ""], 2, '"" is not the name of a scene; give one'),
    (["new", "made/.toml"], 2, '"made/.toml" is not the name of a scene; give one'),
    (
        ["resume", "."],
        2,
        ".: is not the directory of a run; give the directory that a run was written to",
    ),
    (
        ["run", CAVITY, "--out", ""],
        2,
        "argument --out: the name is empty; give the name of a directory",
    ),
    (["judge", "x.toml", "--out", " "], 2, "argument --out: the name is empty; give the name of"),
    (
        ["run", CAVITY, "--out", "taken"],
        5,
        "taken: cannot be written: file exists; a file stands where",
    ),
    (
        ["run", CAVITY, "--out", "taken/x"],
        5,
        "taken/x: cannot be written: not a directory; a file stands",
    ),
    (
        ["run", CAVITY, "--out", "/proc/x"],
        5,
        "/proc/x: cannot be written: no such file or directory",
    ),
    (["calibrate", "x.toml", "--jobs", "2"], 2, "calibrate: is retired; `incipient cost SCENE`"),
    (["table", "x.sqlite", "--parquet", "y"], 2, "argument --parquet: is retired; in Python use"),
    (["run", "a\x1b[31m.toml"], 2, r"a\x1b[31m.toml: has control characters, which terminals"),
    (["run", "a.toml", "--set", "fluid.reynolds=20\r"], 2, "is printed; remove them"),
    (["frobnicate"], 2, "'frobnicate' (choose from 'flume', 'run', 'resume', 'threshold', 'gust'"),
    (["frobnicate"], 2, "'table', 'judge', 'new', 'schema'); see incipient --help"),
    (["run"], 2, "the following arguments are required: scene; see incipient run --help"),
    *(
        ([command, CAVITY, *words], 2, f"unrecognized arguments: {says} --help")
        for command, words, says in (
            ("run", ["--output", "x"], "--output x (did you mean --out?); see incipient run"),
            ("judge", ["--serise=x"], "--serise=x (did you mean --series?); see incipient judge"),
            ("plan", ["y", "--zz"], "y --zz; see incipient plan"),
        )
    ),
    (["run", CAVITY, "--log-level", "loud"], 2, "argument --log-level: invalid choice: 'loud'"),
]


@pytest.mark.parametrize("ranks", [1, 2])
def test_bad_input_is_refused_in_one_line(session, tmp_path, ranks):
    (tmp_path / "taken").touch()
    for name, (text, _) in BAD_SCENES.items():
        (tmp_path / f"{name}.toml").write_text(text)
    cases = [
        (["run", f"{name}.toml"], 2, f"{name}.toml: {why}") for name, (_, why) in BAD_SCENES.items()
    ]
    cases += BAD_COMMANDS
    outcomes = session(ranks, [arguments for arguments, _, _ in cases])
    for (_, code, why), outcome in zip(cases, outcomes, strict=True):
        assert why in outcome.complaint
        assert outcome.codes == [code] * ranks
        if code == 2:
            assert len(outcome.lines) == 1, outcome.lines


@pytest.mark.parametrize("ranks", [1, 2])
def test_bad_input_ends_the_processes_themselves(command, ranks):
    done = command("run", CAVITY, "--set", "fluid.reynolds=0", ranks=ranks, code=2)
    assert done.stdout == ""
    (line,) = [line for line in done.stderr.splitlines() if "fluid.reynolds" in line]
    assert line.startswith(
        "incipient: --set fluid.reynolds=0: fluid.reynolds: is 0; give a number greater than 0"
    )
    assert ranks > 1 or done.stderr.count("\n") == 1


# What a newcomer reads first about a grain that does not rest where it was put down.


TILTED = 'body={shape = "ellipse", semi_axes = [0.6, 0.4], angle = 30.0, x = 4.0, density = 2.65}'


def test_a_grain_that_its_weight_moves_is_told_to_settle_by_run_and_threshold() -> None:
    small = ["domain.length=8.0", "domain.height=4.0", "numerics.mesh_size=5.0"]
    tilted = load(GRAIN_ON_BED, [TILTED, *small, "numerics.error_bars=false"])
    says = "with body.settle = true it first"
    assert f"\n                    {says} rolls" in incipient.run(tilted).text()
    assert f"without any flow; {says}" in find_threshold(tilted, MPI.COMM_WORLD).text()


# One scene in other units and far from the origin: the same mesh, the same loads.


def scene(
    unit: float = 1.0, left: float = 0.0, low: float = 0.0, body: str = "angle = 0.0"
) -> Scene:
    """An ellipse on a wavy bed; `unit` is the length that one was, `left` and `low` where the domain's corner is."""
    u = unit
    return loads(
        f"""
        domain = {{length = {8 * u!r}, height = {4 * u!r}, origin = [{left * u!r}, {low * u!r}]}}
        fluid = {{reynolds = 20.0, scale = "grain"}}
        flow = {{kind = "shear"}}
        bed = {{kind = "sinusoidal", amplitude = {0.05 * u!r}, wavelength = {2 * u!r}, phase = 40.0}}
        gravity = {{acceleration = {u!r}}}
        contact = {{friction = 0.5}}
        numerics = {{error_bars = false, mesh_size = 4.0}}
        [body]
        shape = "ellipse"
        semi_axes = [{0.6 * u!r}, {0.4 * u!r}]
        x = {(left + 3.3) * u!r}
        density = 2.65
        {body}
        """
    )


def loads_of(computed: Result, unit: float) -> NDArray[np.float64]:
    """Force and couple over V^2 L and V^2 L^2, V and L being the unit."""
    return np.array([*computed.force.flow[:2] / unit**3, computed.torque.flow[2] / unit**4])


@pytest.fixture(scope="module")
def usual() -> NDArray[np.float64]:
    return loads_of(incipient.run(scene()), 1.0)


@pytest.mark.parametrize(
    ("unit", "left", "low", "error"),
    [(1e-6, 0, 0, 1e-9), (7e5, 0, 0, 1e-9), (1.0, 4.0, -2.0, 1e-10), (1.0, 4e5, 5.4e6, 1e-6)],
)
def test_neither_unit_nor_place_changes_the_loads(
    usual: NDArray[np.float64], unit: float, left: float, low: float, error: float
) -> None:
    computed = loads_of(incipient.run(scene(unit, left, low)), unit)
    assert computed == pytest.approx(usual, rel=error)


def test_a_grain_settles_far_from_the_origin_as_it_does_there() -> None:
    near, far = (
        scene(1.0, left, low, "angle = 50.0\nsettle = true")
        for left, low in ((0.0, 0.0), (4e5, 5.4e6))
    )
    shift = np.subtract(far.placement.centre, near.placement.centre)
    assert shift == pytest.approx([4e5, 5.4e6], abs=2e-9)
    assert far.placement.angle == pytest.approx(near.placement.angle, abs=1e-9)


def test_numbers_too_far_apart_are_refused_as_such() -> None:
    with pytest.raises(
        ConvergenceError,
        match=r"numbers differ by a factor of .*: choose units in .* fluid\.reynolds",
    ):
        incipient.run(scene(1e-9))


# What a result gives to a program: the flow at points, one line for a reader.


COARSE_IN_PYTHON = ("numerics.mesh_size=4", "numerics.error_bars=false", "output.fields=false")


def test_the_flow_at_points_and_none_outside() -> None:
    """Far above the grain the flow is the given shear, v = (y, 0) above the bed's crest at y = 0."""
    computed = incipient.run(on_bed(*COARSE_IN_PYTHON), comm=MPI.COMM_SELF)
    centre = computed.grain["centre"][:2]
    far, within, below = [1.0, 10.0], centre, [5.0, -1.0]
    above, *none = computed.at([far, within, below])
    assert none == [None, None]
    assert above.velocity == pytest.approx([10.0, 0.0], abs=0.05)
    assert above.velocity == pytest.approx(sample(computed.velocity, np.array([far]))[0])
    (single,) = computed.at(far)
    assert single.pressure == above.pressure
    assert "give an array (n, 2)" in message(lambda: computed.at([1.0, 2.0, 3.0]))
