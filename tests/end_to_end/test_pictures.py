"""Pictures of flows, thresholds, judged cases and moving grains."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from functools import cache, reduce
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from floating import box_around
from matplotlib.collections import LineCollection
from matplotlib.patches import PathPatch, Polygon
from PIL import Image
from processes import assert_is_a_picture, texts_of
from scenes import CASES, POCKET, on_bed

import incipient
import incipient.judging.case as cases
from incipient.arrays import spatial
from incipient.cli import main
from incipient.contact import Contacts, Load
from incipient.contact.verdict import judge
from incipient.errors import OutputError
from incipient.files import MARK, plain, write_json
from incipient.geometry.placement import Placement
from incipient.geometry.plane.grains import Ellipse
from incipient.output.series_file import SeriesFile, StoredStep
from incipient.output.xdmf import QuadraticNodes
from incipient.pictures import animate_apart, draw_apart, style, surfaces, trajectory, verdict
from incipient.pictures import film as films
from incipient.pictures.directory_pictures import draw
from incipient.pictures.judged import judged
from incipient.pictures.record import read
from incipient.pictures.style import STATES
from incipient.pictures.trajectory import read_history
from incipient.pictures.verdict import of_threshold, sketched
from incipient.scene import loads

# Pictures of flows, thresholds and judged cases.


# Pictures of coarse runs: a disc on a flat bed, a box without a grain.


FLOW_PICTURES = ["flow.png", "pressure.png", "vorticity.png"]
SMALL = (
    "domain.length=12",
    "domain.height=6",
    "body.x=4",
    "numerics.mesh_size=3",
    "numerics.order=2",
)
ALONE = "numerics.error_bars=false"
BOX = """
domain = {{kind = "box", length = 1.0, height = 1.0}}
fluid = {{reynolds = 100.0, scale = "flow"}}
flow = {{kind = "{flow}"}}
numerics = {{mesh_size = 4.0, order = 2, error_bars = false}}
"""


FLOW, COUPLE, WEIGHT = [np.pi, 0.5, 0.0], [0.0, 0.0, -0.3], [0.0, -2.0, 0.0]
POINTS = [
    [-0.5, -np.sqrt(0.75), 0.0],
    [0.5, -np.sqrt(0.75), 0.0],
]  # on the unit circle, so also normals


def verdict_on(flow):
    """Both judges on a disc in a pocket of two, as a result holds them."""
    load, contacts = Load(flow, COUPLE, WEIGHT, np.zeros(3)), Contacts(POINTS, POINTS)
    return plain(judge(load, contacts, 0.4, (np.pi, np.eye(3))).to_dict())


@pytest.fixture(scope="module")
def disc_on_bed(tmp_path_factory):
    """The directory of a run. Not to be written to."""
    directory = tmp_path_factory.mktemp("disc_on_bed")
    incipient.run(on_bed(*SMALL, ALONE), directory)
    return directory


@pytest.fixture
def grain_run(disc_on_bed, tmp_path):
    """That run, in which a test may change something."""
    return shutil.copytree(disc_on_bed, tmp_path, dirs_exist_ok=True)


@pytest.mark.parametrize("flow", ["lid", "still"])
def test_a_box_without_a_grain_has_flow_pictures_alone(flow, tmp_path):
    """Also of a fluid at rest, in which there is no range of colours to choose."""
    incipient.run(loads(BOX.format(flow=flow)), tmp_path)
    written = draw(tmp_path)
    assert written == [tmp_path / name for name in (*FLOW_PICTURES, "mesh.png")]
    for path in written:
        assert_is_a_picture(path)


RESTING = verdict_on([0.1, 0.0, 0.0])


@pytest.mark.parametrize(
    ("stored", "shown", "absent"),
    [
        (
            verdict_on(FLOW),
            [
                "The grain begins to move (pivoting), safety factor ",
                "By the paper's criteria it begins to move",
                *("flow\n", "weight\n", "resultant\n"),
                "(3.142, −1.5)",  # the resultant of flow, buoyancy and weight
                "coefficient of static friction\n0.4\n",
                *("contact lifts off", "contact rolls without slip"),
            ],
            "carries no force",
        ),
        (RESTING, ["contact force on the grain, a set that balances the load"], "acceleration"),
        (RESTING | {"first_motion": 0.5}, ["the end of the run: the flow would"], "acceleration"),
    ],
    ids=["moves", "rests", "would have moved before"],
)
def test_a_verdict_is_told_in_words_and_numbers(grain_run, stored, shown, absent):
    record = grain_run / "result.json"
    record.write_text(json.dumps(json.loads(record.read_text()) | {"verdict": stored}))
    text = "\n".join(texts_of(verdict.of_run(read(grain_run))))
    assert [words for words in shown if words not in text] == [] and absent not in text


def test_all_pictures_of_a_grain_without_a_screen_or_a_warning(grain_run):
    environment = {key: value for key, value in os.environ.items() if "DISPLAY" not in key}
    imports = "from pathlib import Path; from incipient.pictures.directory_pictures import draw"
    program = f"{imports}; draw(Path({str(grain_run)!r}))"
    # Debian's matplotlib beside the one in .venv makes that one warn of it.
    warnings = ("-W", "error", "-W", "ignore:Unable to import Axes3D")
    process = subprocess.run(
        [sys.executable, *warnings, "-c", program],
        env=environment, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert (process.returncode, process.stdout, process.stderr) == (0, "", "")
    written = {path.name for path in grain_run.glob("*.png")}
    assert written == {*FLOW_PICTURES, "traction.png", "verdict.png", "mesh.png"}
    for name in written:
        assert_is_a_picture(grain_run / name)


def test_a_missing_field_and_a_file_that_cannot_be_written_take_no_other_picture_with_them(
    grain_run,
):
    step = read(grain_run).fields
    write_series(grain_run, [0.0], step, {"velocity": step.fields["velocity"]})
    (grain_run / "flow.png").mkdir()
    drawn = draw_apart(grain_run)
    assert drawn.complaint.startswith(f"not drawn: {grain_run / 'flow.png'}: cannot be written")
    assert f"{grain_run / 'fields'}: holds no pressure" in drawn.complaint
    assert [path.stem for path in drawn.paths] == ["traction", "verdict", "mesh"]


def test_plane_of_a_mesh_with_a_hole(disc_on_bed):
    """Its outline, its grain, and a linear velocity sampled on a grid within the fluid."""
    run = read(disc_on_bed)
    points = run.fields.points
    centre = run.result["grain"]["computed_centre"][:2]
    linear = np.column_stack([points[:, 0] - 3.0 * points[:, 1], 2.0 * points[:, :2]])
    plane = replace(run, fields=replace(run.fields, fields={"velocity": linear})).plane
    (outer, hole), (outline,) = plane.outlines, plane.grains
    assert np.allclose(np.linalg.norm(outline - centre, axis=1), 0.5)
    assert (np.isclose(outer, 0.0) | np.isclose(outer, [12.0, 6.0])).any(axis=1).all()
    # Its sides are quadratic and drawn in four pieces.
    assert np.allclose(np.linalg.norm(hole - centre, axis=1), 0.5, atol=1e-6)
    assert len(hole) >= 4 * len(run.surface.cells)
    x, y, (value, other) = plane.velocities((2.0, 6.0, 0.0, 2.0), 50)
    across, up = np.meshgrid(x, y)
    radius = np.hypot(across - centre[0], up - centre[1])
    assert value.mask[radius < 0.495].all() and not value.mask[radius > 0.5].any()
    assert np.allclose(value, across - 3.0 * up, rtol=0.0, atol=1e-12)
    assert np.allclose(other, 2.0 * across, rtol=0.0, atol=1e-12)


def test_components_of_the_traction_are_those_along_normal_and_surface(disc_on_bed):
    run = read(disc_on_bed)
    normal, tangential = surfaces.traction(run).axes[1].lines[:2]
    middle = run.surface.cells[:, 2]
    arms = run.surface.points[middle, :2] - run.result["grain"]["computed_centre"][:2]
    directions = np.degrees(np.arctan2(arms[:, 1], arms[:, 0])) % 360
    pushes, pulls = np.array([arms, arms[:, ::-1] * [-1.0, 1.0]]) / 0.5
    for line, along in ((normal, pushes), (tangential, pulls)):
        values = (run.surface.fields["traction"][middle, :2] * along).sum(axis=1)
        shown = line.get_xydata()[np.isfinite(line.get_ydata())]
        expected = sorted(zip(directions, values, strict=True))
        assert shown == pytest.approx(np.array(expected), abs=1e-9 * np.abs(values).max())


# Pictures of thresholds and of judged cases.


MASS_AND_INERTIA = 1.0, 0.1 * np.eye(3)
CORNERS = np.array([[-0.5, -0.4, 0.0], [0.5, -0.4, 0.0], [0.5, 0.4, 0.0], [-0.5, 0.4, 0.0]])


@pytest.fixture(scope="module")
def threshold_of(tmp_path_factory):
    """`threshold_of(*overrides)`: the directory of a threshold in creeping flow, found once. Not to be written to."""

    @cache
    def result(*overrides):
        directory = tmp_path_factory.mktemp("threshold")
        incipient.threshold(on_bed(*SMALL, ALONE, "fluid.inertia=false", *overrides), directory)
        return directory

    return result


def judged_case(directory, name, *overrides, shaped=True):
    path = CASES / f"{name}.toml"
    few = ("errors.samples=20",) if "[errors]" in path.read_text() else ()
    said = cases.judge_case(cases.load_case(path, (*few, *overrides)))
    if not shaped:
        del said["case"]
    write_json(directory / "judgement.json", said)
    return directory


# -- thresholds and cases ----------------------------------------------------------------------------------


@pytest.mark.parametrize("overrides", [POCKET, (), (*POCKET, "contact.friction=5.0")])
def test_thresholds_are_drawn_and_why_there_is_none_is_said(threshold_of, overrides):
    """A disc on a plane rolls in any flow; friction wedges one in a pocket in all flows."""
    directory = threshold_of(*overrides)
    (written,) = draw(directory)
    assert written.name == "threshold.png"
    assert_is_a_picture(written)
    stored = json.loads((directory / "threshold.json").read_text())
    title = texts_of(of_threshold(stored, directory))[0].replace("\n", " ")
    assert title == f"Threshold: {stored['sentence']}."
    states = judged(stored["verdict"]).states
    assert set(states) <= STATES.keys()
    # At the threshold the grain in its pocket is held by one of its two contacts alone.
    assert overrides != POCKET or states[0] == "UNLOADED"


@pytest.mark.parametrize(
    ("name", "flow"),
    [
        ("block_on_incline", ""),
        ("disc_in_pocket", ""),
        pytest.param("sphere_on_three_spheres", "[0.2, 0.0, 0.0]", marks=pytest.mark.slow),  # rests
        pytest.param("sphere_on_three_spheres", "[0.4, 0.1, 0.05]", marks=pytest.mark.slow),
    ],
)
def test_cases_are_drawn(tmp_path, name, flow):
    judged_case(tmp_path, name, *([f"load.flow_force={flow}"] if flow else []))
    (written,) = draw_apart(tmp_path).paths
    assert written == tmp_path / "judgement.png"
    assert_is_a_picture(written)


def test_a_case_that_gives_a_shape_is_drawn_with_it(tmp_path):
    pictures = [
        verdict.of_judgement(json.loads((directory / "judgement.json").read_text()), directory)
        for directory in (
            judged_case(tmp_path, "disc_in_pocket", shaped=shaped) for shaped in (True, False)
        )
    ]
    titles = [picture.axes[0].get_title() for picture in pictures]
    assert titles[1] == f"{titles[0]}; the grain is sketched"


# -- damaged results ---------------------------------------------------------------------------------------


def away(name):
    return lambda directory: (directory / name).rename(directory / "away")


def without(key, value=None, record="threshold.json"):
    """Remove a key from a record, or give it another value."""

    def damage(directory):
        stored = json.loads((directory / record).read_text())
        *sections, last = key.split(".")
        within = reduce(dict.__getitem__, sections, stored)
        within.update({last: value}) if value is not None else within.pop(last)
        (directory / record).write_text(json.dumps(stored))

    return damage


FINISHED = "give the directory of a finished run"
OF_VERDICT = "verdict.judges.equilibrium.safety"
DAMAGES = [
    ("run", away("result.json"), rf"result\.json: .*{FINISHED}"),
    ("run", away("scene.toml"), rf"scene\.toml: .*{FINISHED}"),
    ("run", away("fields"), r"fields: .*output\.fields = true"),
    ("run", away("surface"), r"surface: .*output\.fields = true"),
    ("run", lambda run: (run / "result.json").write_text("{"), r"result\.json: cannot be read"),
    (
        "run",
        lambda run: (run / "fields" / "000000.h5").write_bytes(b"nothing"),
        r"000000\.h5: cannot be read: it is damaged or incomplete; run",
    ),
    *(
        ("run", without(f"verdict.{key}", record="result.json"), rf"result\.json: holds no {key}")
        for key in ("judges", "sentence", "safety_factor")
    ),
    *(
        ("threshold", without(key), rf"threshold\.json: holds no {key}")
        for key in ("factor", "ranges", "shields", "mode", "verdict", "trials", "sentence")
    ),
    ("threshold", away("scene.toml"), r"scene\.toml: cannot be read .No such file"),
    ("threshold", without("trials", 3), r"threshold\.png: cannot be drawn: TypeError"),
    ("case", without(OF_VERDICT, record="judgement.json"), r"judgement\.json: holds no safety"),
    ("case", without("verdict", record="judgement.json"), r"judgement\.json: holds no verdict"),
    ("case", without("case.load.weight", [3], "judgement.json"), "another version, whose scene"),
]


@pytest.mark.parametrize(("results", "damage", "complaint"), DAMAGES)
def test_damaged_results_are_named(tmp_path, results, damage, complaint, disc_on_bed, threshold_of):
    if results == "run":
        shutil.copytree(disc_on_bed, tmp_path, dirs_exist_ok=True)
    elif results == "threshold":
        shutil.copytree(threshold_of(*POCKET), tmp_path, dirs_exist_ok=True)
    else:
        judged_case(tmp_path, "disc_in_pocket")
    damage(tmp_path)
    with pytest.raises(OutputError, match=complaint):
        draw(tmp_path)


# -- what is shown of them ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pushed", "inert", "states", "share", "acceleration"),
    [
        (0.2, MASS_AND_INERTIA, {"INSIDE", "EDGE"}, 1.0, None),
        (0.6, MASS_AND_INERTIA, {"SLIDE"}, 1.0, [0.1, 0.0, 0.0]),  # friction 0.5 holds of weight 1
        # Without mass the forces are those at the safety factor: friction holds half of the weight.
        (0.6, None, {"INSIDE", "EDGE"}, 0.5 / 0.6, None),
    ],
    ids=["rests", "slides", "without mass"],
)
def test_contact_forces_balance_the_load_within_their_cones(
    pushed, inert, states, share, acceleration
):
    contacts = Contacts(CORNERS, np.tile([0.0, 0.0, -1.0], (4, 1)), np.full(4, 0.2))
    acting = Load([pushed, 0.0, 0.0], np.zeros(3), [0.0, 0.0, -1.0], [0.0, 0.0, 0.3])
    case = judged(plain(judge(acting, contacts, 0.5, inert).to_dict()))
    forces, moves = case.forces, acceleration is not None
    assert set(case.states) <= states and case.share == pytest.approx(share, rel=1e-6)
    assert (case.motion is not None) is moves and case.friction == 0.5
    if moves:
        assert np.allclose(case.motion[0], acceleration, atol=1e-6)
    held = share * acting.flow_force + acting.weight - np.array(acceleration or [0.0, 0.0, 0.0])
    assert np.allclose(forces.sum(axis=0) + held, 0.0, atol=1e-6)
    turning = np.cross(case.contacts.points - acting.centre, forces).sum(axis=0)
    assert np.allclose(turning + acting.flow_couple, 0.0, atol=1e-6)
    assert (np.hypot(*forces[:, :2].T) <= 0.5 * forces[:, 2] * (1 + 1e-6)).all()
    assert ("balances 0.8333 times" in case.occasion) is (share != 1.0)


@pytest.mark.parametrize(
    ("name", "radius"), [("sphere_on_three_spheres", 0.5), ("block_on_incline", np.hypot(1.0, 0.5))]
)
def test_grains_without_a_shape_are_sketched_through_their_contacts(tmp_path, name, radius):
    directory = judged_case(tmp_path, name)
    case = judged(json.loads((directory / "judgement.json").read_text())["verdict"])
    shape = sketched(case)
    assert shape.grain.size == pytest.approx(2.0 * radius)
    assert (shape.placement.gdim == 2) is case.planar
    assert shape.placement.centre == pytest.approx(case.load.centre[: shape.placement.gdim])


# Pictures and animations of a made-up run: an ellipse carried round a box by a vortex, on a new mesh at each step. The
# flow is the vortex alone, as if the ellipse were not there.


LENGTH, HEIGHT, SEMI_AXES = 6.0, 4.0, (0.5, 0.25)
MIDDLE, ORBIT, PERIOD, TURNS = (3.0, 2.0), (1.4, 0.8), 5.0, -1.25
MOVING_SCENE = """
title = "An ellipse in a vortex"
[domain]
kind = "box"
length = 6.0
height = 4.0
[fluid]
reynolds = 10.0
scale = "flow"
[flow]
kind = "lid"
[body]
shape = "ellipse"
semi_axes = [0.5, 0.25]
centre = [4.4, 2.0]
motion = "free"
density = 1.0
[time]
end = 5.0
step = 0.05
[output]
every = 1
"""
RESULT = {
    "schema_version": 1,
    "title": "An ellipse in a vortex",
    "force": {"flow": [0.3, -0.1, 0.0], "buoyancy": [0, 0, 0], "weight": [0, 0, 0]},
    "torque": {"about": [4.4, 2.0, 0.0], "flow": [0, 0, 0.02]},
    "coefficients": {"drag": 1.0, "lift": 0.5, "moment": 0.1},
    "contacts": [],
    "grain": {"centre": [4.4, 2.0], "computed_centre": [4.4, 2.0], "angle": 2 * np.pi * TURNS},
    "verdict": None,
}
COLUMNS = [
    "time",
    "step",
    "newton",
    "error",
    "x",
    "y",
    "angle",
    "velocity_x",
    "velocity_y",
    "spin",
    "force_x",
    "force_y",
    "torque",
    "interface",
    "interface_residual",
    "mesh_quality",
    "meshes",
    "energy_fluid",
    "energy_body",
    "dissipation",
    "power",
]
STEPS = 10


def course(times):
    """Columns x, y, angle and their rates at times (n,)."""
    t, rate = 2 * np.pi * np.asarray(times) / PERIOD, 2 * np.pi / PERIOD
    x, y = MIDDLE[0] + ORBIT[0] * np.cos(t), MIDDLE[1] - ORBIT[1] * np.sin(t)
    angle = TURNS * t + 0.3 * np.sin(2 * t)
    u, v = -ORBIT[0] * rate * np.sin(t), -ORBIT[1] * rate * np.cos(t)
    return np.column_stack([x, y, angle, u, v, rate * (TURNS + 0.6 * np.cos(2 * t))])


def write_history(path: Path, times) -> None:
    """A history with all columns a run with a free body has; time and path are not zero."""
    table = np.zeros((len(times), len(COLUMNS)))
    table[:, 0], table[:, 4:10] = times, course(times)
    np.savetxt(path, table, delimiter=",", header=",".join(COLUMNS), comments="")


def write_texts(directory: Path) -> None:
    """Scene and result."""
    (directory / "scene.toml").write_text(MOVING_SCENE)
    (directory / "result.json").write_text(json.dumps(RESULT))


def vortex(x):
    """Fields of psi = -(sin(pi x/L) sin(pi y/H))^2, at rest on the walls, at (n, 2)."""
    (a, b), (p, q) = (
        x.T * np.array([[np.pi / LENGTH], [np.pi / HEIGHT]]),
        (np.pi / LENGTH, np.pi / HEIGHT),
    )
    u, v = -q * np.sin(a) ** 2 * np.sin(2 * b), p * np.sin(2 * a) * np.sin(b) ** 2
    curl = 2 * p**2 * np.cos(2 * a) * np.sin(b) ** 2 + 2 * q**2 * np.sin(a) ** 2 * np.cos(2 * b)
    velocity = np.column_stack([u, v, np.zeros_like(u)])
    pressure = 0.5 * np.cos(a) * np.cos(b)
    return {"velocity": velocity, "pressure": pressure, "vorticity": curl, "traction": velocity}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    directory = tmp_path_factory.mktemp("moving")
    write_texts(directory)
    write_history(directory / "history.csv", np.linspace(0.0, PERIOD, 101)[1:])
    kinds = {"fields": "Triangle_6", "surface": "Edge_3"}
    fields, surface = (SeriesFile(directory / stem, kind) for stem, kind in kinds.items())
    for file in (fields, surface):
        file.begin()
    for time in np.linspace(0.0, PERIOD, STEPS + 1)[1:]:
        x, y, angle, *_ = course([time])[0]
        placement = Placement((x, y), angle)
        domain = box_around(Ellipse(SEMI_AXES), placement, 0.15, 0.5, high=(LENGTH, HEIGHT))
        for file, facets in ((fields, None), (surface, domain.facets_of("body"))):
            nodes = QuadraticNodes(domain.mesh, facets)
            mesh = {"topology": nodes.topology, "geometry": nodes.coordinates()}
            file.add_step(time, vortex(mesh["geometry"][:, :2]), mesh)
    return directory


@pytest.fixture
def texts(tmp_path):
    """A directory with scene, result and history only."""
    write_texts(tmp_path)
    write_history(tmp_path / "history.csv", np.linspace(0.0, PERIOD, 51)[1:])
    return tmp_path


def drawn(scene_text, history):
    scene = loads(scene_text)
    with style.applied():
        return trajectory.figure(scene, history, scene.title)


# -- pictures ------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_all_pictures_of_a_grain_that_moves(run):
    written = draw_apart(run).paths
    names = ["trajectory", "flow", "pressure", "vorticity", "traction", "mesh"]
    assert [path.stem for path in written] == names
    for path in written:
        assert_is_a_picture(path)


def test_path_outlines_and_quantities_are_those_of_the_history(texts):
    figure = drawn(MOVING_SCENE, read_history(texts / "history.csv"))
    axes = figure.axes[0]
    panels = [panel for k in "012345" for panel in figure.axes if panel.get_label() == k]
    (path,) = [c for c in axes.collections if isinstance(c, LineCollection)]
    segments = path.get_segments()
    assert np.allclose([segments[0][0], segments[-1][-1]], course([0.1, PERIOD])[:, :2])
    outlines = [artist for artist in axes.get_children() if isinstance(artist, Polygon)]
    assert 8 <= len(outlines) <= 22
    extents = [np.ptp(outline.get_xy(), axis=0) for outline in outlines]
    assert any(np.allclose(e, (0.5, 1.0), atol=1e-3) for e in extents)  # after 5/4 turns it stands
    names = ("x", "y", "angle", "velocity x", "velocity y", "spin")
    times = np.linspace(0.0, PERIOD, 51)[1:]
    values = course(times) * [1.0, 1.0, np.degrees(1.0), 1.0, 1.0, 1.0]
    for panel, name, column in zip(panels, names, values.T, strict=True):
        assert panel.get_title(loc="left").startswith(f"{name} [")
        (line,) = panel.lines
        assert np.allclose(line.get_xydata(), np.column_stack([times, column]), atol=1e-9)


def test_a_grain_that_hardly_moves_is_not_shown_as_trembling(texts):
    write_history(texts / "history.csv", np.linspace(0.0, 1.0, 11)[1:])
    history = read_history(texts / "history.csv")
    history.columns["x"][:] = 4.4 + 1e-15 * np.arange(10)
    figure = drawn(MOVING_SCENE, history)
    panel = next(axes for axes in figure.axes if axes.get_title(loc="left").startswith("x ["))
    assert np.ptp(panel.get_ylim()) > 1e-3


# -- the history ---------------------------------------------------------------------------------------------


def test_headings_may_have_units_and_the_last_row_may_be_incomplete(texts):
    path = texts / "history.csv"
    path.write_text(path.read_text().replace("time,", "time [scene units],", 1) + "5.1,0.05,3")
    assert len(read_history(path).times) == 50


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (None, r"cannot be read \(No such file"),
        ("", "holds no time"),
        ("time,drag\n1,2\n", "holds no x"),
        ("time,x,y,angle\n", "holds no place"),
        ("time,x,y,angle\n1,2\n1,2,3,4\n1\n", "cannot be read"),
        ("time,x,y,angle\n1,2,3,left\n", "cannot be read"),
        ("time,x,y,angle\n1,2,3,\n", "holds no place"),
    ],
)
def test_a_damaged_history_is_named(text, complaint, texts):
    path = texts / "history.csv"
    path.unlink() if text is None else path.write_text(text)
    with pytest.raises(OutputError, match=rf"history\.csv: {complaint}.*; "):
        read_history(path)


# -- animations ----------------------------------------------------------------------------------------------


def test_the_grain_is_where_its_mesh_is(run):
    indices, moments = films._frames(run / "fields")
    film = films._Film(run, films.FIELDS["velocity"], indices, moments)
    for number in (0, STEPS // 2, STEPS - 1):
        film.show(number)
        (axes, *_) = film.figure.axes
        paths = [p.get_path().vertices for p in axes.patches if isinstance(p, PathPatch)]
        body = min(paths, key=np.ptp)
        expected = course([moments[number]])[0]
        middle = (body.max(axis=0) + body.min(axis=0)) / 2
        assert np.allclose(middle, expected[:2], atol=5e-3)
        (spoke,) = [line for line in axes.lines if line.get_marker() == "o"]
        assert np.allclose(axes.lines[-1].get_xydata()[-1], expected[:2], atol=5e-3)
        arm = np.diff(spoke.get_xydata(), axis=0)[0]
        along = np.array([np.cos(expected[2]), np.sin(expected[2])])
        assert np.allclose(arm, 0.5 * along, atol=3e-2)
        assert f"t = {moments[number]:.2f}" in axes.get_title(loc="left")


def write_series(directory, times, mesh, fields):
    """The same fields on the mesh of a step at all times."""
    file = SeriesFile(directory / "fields", "Triangle_6")
    file.begin()
    for time in times:
        file.add_step(time, fields, {"topology": mesh.cells, "geometry": mesh.points})


def write_rest(directory, times):
    """Fluid at rest in one cell."""
    points = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    cell = StoredStep(0.0, spatial(points), np.arange(6)[None], {})
    at_rest = {"velocity": np.zeros((6, 3)), "pressure": np.zeros(6), "vorticity": np.zeros(6)}
    write_series(directory, times, cell, at_rest)


def test_of_many_steps_those_evenly_spaced_in_time_are_shown(tmp_path, monkeypatch):
    monkeypatch.setattr(films, "_MOST_FRAMES", 20)
    times = np.concatenate([np.linspace(0, 0.01, 10), np.linspace(0.04, 1.0, 25)])
    write_rest(tmp_path, times)
    indices, moments = films._frames(tmp_path / "fields")
    assert 15 < len(indices) <= 20
    assert (moments[0], moments[-1]) == (0.0, 1.0)
    assert np.diff(moments).max() < 0.1
    assert np.array_equal(moments, times[indices])


def test_fluid_at_rest_is_animated(texts):
    """Of a flow without any difference there is no range of colours to choose."""
    write_rest(texts, [0.0, 1.0])
    for field in films.FIELDS:
        assert Image.open(films.animate(texts, None, field)).n_frames == 2


def test_an_mp4_is_written_with_ffmpeg(run, tmp_path):
    if shutil.which("ffmpeg") is None:
        pytest.skip("ffmpeg is not installed")
    path = animate_apart(run, tmp_path / "flow.mp4", "vorticity")
    assert path.read_bytes()[4:8] == b"ftyp"
    assert sorted(tmp_path.iterdir()) == [tmp_path / MARK, path]


@pytest.mark.parametrize(
    ("options", "name"),
    [
        pytest.param((), "velocity.gif", marks=pytest.mark.slow),
        (("--field", "pressure", "--out", "p.gif"), "p.gif"),
    ],
)
def test_show_animates(run, command, options, name):
    """Also with the directory after the options: a small GIF with a frame for each step, in which something moves."""
    done = command("show", "--animate", *(run / one if "." in one else one for one in options), run)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{run / name}\n", "")
    image = Image.open(run / name)
    assert image.format == "GIF" and image.n_frames == STEPS
    # With arrows 37 kB a frame, so that 200 take 7 MB.
    assert (run / name).stat().st_size < STEPS * 40_000
    frames = []
    for number in range(STEPS):
        image.seek(number)
        frames.append(np.asarray(image.convert("RGB")).astype(int))
    assert all((one != other).any(axis=2).mean() > 0.005 for one, other in pairwise(frames))


def test_what_cannot_be_animated_is_named_with_the_remedy(run, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "/nowhere")
    single, folder = tmp_path / "single", tmp_path / "folder.gif"
    for made in (single, folder):
        made.mkdir()
    write_rest(single, [1.0])
    cases = {
        (
            single,
            None,
        ): "fields: holds a single step; run the scene with [time] and --set output.every=1",
        (tmp_path, None): "fields: holds no fields; run the scene with output.fields = true",
        (run, "x.avi"): "x.avi: is not a name for an animation; let it end in .gif or .mp4",
        (
            run,
            "x.mp4",
        ): "x.mp4: MP4 needs ffmpeg, which is not installed; install it or write a .gif",
        (
            run,
            "absent/x.gif",
        ): "x.gif: cannot be written: no such file or directory; make the directory first",
        (
            run,
            "folder.gif",
        ): "folder.gif: cannot be written: is a directory; a directory has the name of the file",
    }
    for (directory, name), complaint in cases.items():
        with pytest.raises(OutputError, match=re.escape(complaint)):
            films.animate(directory, name and tmp_path / name)
    assert {path.name for path in tmp_path.iterdir()} == {MARK, "single", "folder.gif"}


@pytest.mark.parametrize(
    ("options", "code", "complaint"),
    [
        (
            ["nothing", "--animate"],
            5,
            "no animation: nothing/fields: holds no fields; run the scene with output.fields = true",
        ),
        (
            ["absent"],
            2,
            "absent: there is no such directory; give the directory that a run was written to",
        ),
        (
            ["nothing", "--field", "pressure"],
            2,
            "--field: needs --animate; add it, or leave --field out",
        ),
        (["nothing", "--out", "flow.gif"], 2, "--out: needs --animate; add it, or leave --out out"),
        (
            ["nothing", "--animate", "flow.gif"],
            2,
            "unrecognized arguments: flow.gif; see incipient show --help",
        ),
    ],
)
def test_show_says_what_is_wrong_in_one_line(
    options, code, complaint, capsys, monkeypatch, tmp_path
):
    (tmp_path / "nothing").mkdir()
    (tmp_path / "nothing" / "result.json").write_text("{}")
    monkeypatch.chdir(tmp_path)
    assert main(["show", *options]) == code
    assert capsys.readouterr() == ("", f"incipient: {complaint}\n")
