"""Pictures of flows, thresholds, judged cases and moving grains."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from dataclasses import asdict
from functools import partial, reduce
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from matplotlib.collections import LineCollection
from matplotlib.patches import Polygon
from PIL import Image
from processes import assert_is_a_picture, texts_of
from scenes import CASES, POCKET, SCENES

import incipient.judging.case as cases
from incipient.arrays import spatial
from incipient.cli import main
from incipient.contact import Contacts, Load, safety_factor
from incipient.contact.verdict import judge
from incipient.errors import OutputError
from incipient.files import MARK, plain, write_json
from incipient.geometry.settle import touching
from incipient.output.series_file import SeriesFile, StoredStep
from incipient.pictures import animate_apart, draw_apart, style, surfaces, trajectory, verdict
from incipient.pictures import film as films
from incipient.pictures.directory_pictures import draw
from incipient.pictures.judged import judged
from incipient.pictures.record import StoredRun, read
from incipient.pictures.style import STATES
from incipient.pictures.trajectory import read_history
from incipient.pictures.verdict import of_threshold, sketched
from incipient.scene import load, save
from incipient.scene.file import dumps, loads

# Pictures of flows, thresholds and judged cases.


# Pictures of made-up runs: a disc in a square and a box, with flows known in closed form.


RADIUS, SIDE = 1.0, 8.0
FLOW_PICTURES = ["flow.png", "pressure.png", "vorticity.png"]


def quadratic_grid(place, columns, rows, closed=False):
    """Points and 6-node triangles of a grid; `place` maps parameters in [0, 1]^2 to the plane."""
    across = 2 * columns + (0 if closed else 1)
    s, t = np.meshgrid(np.arange(across) / (2 * columns), np.arange(2 * rows + 1) / (2 * rows))

    def node(i, j):
        return j * across + i % across

    cells = []
    for j in range(0, 2 * rows, 2):
        for i in range(0, 2 * columns, 2):
            a, b, c, d = (i, j), (i + 2, j), (i + 2, j + 2), (i, j + 2)
            for corners in (
                (a, b, c),
                (c, a, d),
            ):  # the second runs the other way round, as dolfinx's may
                ring = [*corners, corners[0]]
                mids = [tuple((np.array(p) + q) // 2) for p, q in pairwise(ring)]
                cells.append([node(*p) for p in (*corners, *mids)])
    return place(s.ravel(), t.ravel()), np.array(cells)


def inner_edges(columns):
    """The 3-node edges of a closed grid at t = 0."""
    start = 2 * np.arange(columns)
    return np.column_stack([start, (start + 2) % (2 * columns), start + 1])


def around_disc(s, t):
    """From the disc (t = 0) to a square's boundary (t = 1), finer at the disc."""
    angle = 2 * np.pi * s
    inner = RADIUS * np.array([np.cos(angle), np.sin(angle)])
    outer = SIDE / 2 * inner / np.abs(inner).max(axis=0)
    return ((1 - t**1.5) * inner + t**1.5 * outer).T


def past_disc(points):
    """Velocity, pressure and vorticity of the stream function y (1 - 1/r^2)^2, at rest on the disc."""
    x, y = points.T
    r2 = np.maximum(x**2 + y**2, RADIUS**2)
    g = 1 - 1 / r2
    u = np.column_stack([g**2 + 4 * y**2 * g / r2**2, -4 * x * y * g / r2**2, np.zeros_like(x)])
    return {"velocity": u, "pressure": -x / r2, "vorticity": -8 * y / r2**2 * (2 - 1 / r2)}


def rotation(points):
    x, y = points.T - 0.5
    return {
        "velocity": np.column_stack([-y, x, 0 * x]),
        "pressure": x**2 + y**2,
        "vorticity": 2 + 0 * x,
    }


def write_series(stem, mesh, *steps, kind="Triangle_6"):
    """Fields at times, the steps, on one mesh."""
    file = SeriesFile(stem, kind)
    points, cells = mesh
    file.begin()
    stored = {"topology": cells, "geometry": spatial(points)}
    for number, (time, values) in enumerate(steps):
        file.add_step(time, values, {} if number else stored)


def write_run(directory, mesh, fields, scene, result, surface=None):
    write_series(directory / "fields", mesh, (0.0, fields))
    if surface is not None:
        edges, values = surface
        write_series(directory / "surface", (mesh[0], edges), (0.0, values), kind="Edge_3")
    (directory / "scene.toml").write_text(tomli_w.dumps(scene))
    (directory / "result.json").write_text(json.dumps(result))
    return directory


FLOW, COUPLE, WEIGHT = [np.pi, 0.5, 0.0], [0.0, 0.0, -0.3], [0.0, -2.0, 0.0]
POINTS = [
    [-0.5, -np.sqrt(0.75), 0.0],
    [0.5, -np.sqrt(0.75), 0.0],
]  # on the unit circle, so also normals


def verdict_on(flow):
    """Both judges on a disc in a pocket of two, as a result holds them."""
    load, contacts = Load(flow, COUPLE, WEIGHT, np.zeros(3)), Contacts(POINTS, POINTS)
    return plain(judge(load, contacts, 0.4, (np.pi, np.eye(3))).to_dict())


SCENE = """
[domain]
kind = "channel"
length = 8.0
height = 8.0
origin = [-4.0, -4.0]
[fluid]
reynolds = 20.0
scale = "grain"
[flow]
kind = "shear"
[body]
shape = "disc"
diameter = 2.0
x = 0.0
[bed]
kind = "flat"
[contact]
friction = 0.4
"""


@pytest.fixture
def grain_run(tmp_path):
    columns = 24
    mesh = quadratic_grid(around_disc, columns, 12, closed=True)
    edges = inner_edges(columns)
    edges[::3] = edges[::3][:, [1, 0, 2]]  # dolfinx's facets have no common direction
    values = past_disc(mesh[0])
    traction = -values["pressure"][:, None] * np.column_stack([mesh[0], np.zeros(len(mesh[0]))])
    shuffled = edges[np.random.default_rng(1).permutation(columns)]
    scene = tomllib.loads(dumps(loads(SCENE)))
    result = {
        "schema_version": 1,
        "title": "A disc in a square",
        "force": {"flow": FLOW, "buoyancy": [0, 1.0, 0], "weight": [0, -3.0, 0]},
        "torque": {"about": [0, 0, 0], "flow": COUPLE},
        "contacts": [{"point": point, "normal": point} for point in POINTS],
        "grain": {"centre": [0, 0], "computed_centre": [0, 0], "angle": 0.0},
        "verdict": verdict_on(FLOW),
    }
    return write_run(tmp_path, mesh, values, scene, result, (shuffled, {"traction": traction}))


@pytest.fixture
def box_run(tmp_path, request):
    """A rotation of the fluid in a box, at a rate of one unless asked otherwise."""
    mesh = quadratic_grid(lambda s, t: np.column_stack([s, t]), 8, 8)
    scene = {
        "title": "Rotation",
        "domain": {"kind": "box", "length": 1.0, "height": 1.0},
        "fluid": {"reynolds": 100.0, "scale": "flow"},
        "flow": {"kind": "lid"},
    }
    rate = getattr(request, "param", 1.0)
    fields = {name: rate * values for name, values in rotation(mesh[0]).items()}
    result = {"force": None, "contacts": [], "verdict": None}
    return write_run(tmp_path, mesh, fields, scene, result)


@pytest.mark.parametrize("box_run", [1.0, 0.0], indirect=True)
def test_a_box_without_a_grain_has_flow_pictures_alone(box_run):
    """Also of a fluid at rest, in which there is no range of colours to choose."""
    written = draw(box_run)
    assert written == [box_run / name for name in (*FLOW_PICTURES, "mesh.png")]
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


def test_a_missing_field_and_a_file_that_cannot_be_written_take_no_other_picture_with_them(box_run):
    mesh = quadratic_grid(lambda s, t: np.column_stack([s, t]), 2, 2)
    write_series(box_run / "fields", mesh, (0.0, {"velocity": rotation(mesh[0])["velocity"]}))
    (box_run / "flow.png").mkdir()
    drawn = draw_apart(box_run)
    assert drawn.complaint.startswith(f"not drawn: {box_run / 'flow.png'}: cannot be written")
    assert f"{box_run / 'fields'}: holds no pressure" in drawn.complaint
    assert [path.name for path in drawn.paths] == ["mesh.png"]


def test_plane_of_a_mesh_with_a_hole():
    """Its outline, its grain, and a linear velocity sampled on a grid within the fluid."""
    points, cells = quadratic_grid(around_disc, 48, 24, closed=True)
    linear = np.column_stack([points[:, 0] - 3.0 * points[:, 1], 2.0 * points])
    step = StoredStep(0.0, spatial(points), cells, {"velocity": linear})
    grain = {"computed_centre": [0, 0], "angle": 0.0}
    plane = StoredRun(Path(), {"grain": grain}, loads(SCENE), step, None).plane
    (outer, hole), (outline,) = plane.outlines, plane.grains
    assert np.allclose(np.linalg.norm(outline, axis=1), RADIUS)
    assert np.allclose(np.abs(outer).max(axis=1), SIDE / 2)
    # Sides of 7.5 degrees, quadratic, in four pieces: their ends are within 2e-6 of the circle.
    assert np.allclose(np.linalg.norm(hole, axis=1), RADIUS, atol=2e-6) and len(hole) >= 4 * 48
    x, y, (value, other) = plane.velocities((-2.0, 3.0, -1.0, 1.0), 50)
    across, up = np.meshgrid(x, y)
    radius = np.hypot(across, up)
    assert value.mask[radius < 0.99 * RADIUS].all() and not value.mask[radius > RADIUS].any()
    assert np.allclose(value, across - 3.0 * up, atol=1e-12)
    assert np.allclose(other, 2.0 * across, atol=1e-12)


def test_components_of_the_traction_are_those_along_normal_and_surface(grain_run):
    """The traction is -p = cos(angle) along the normal of the unit circle, nothing along the surface."""
    normal, tangential = surfaces.traction(read(grain_run)).axes[1].lines[:2]
    angles, values = normal.get_data()
    assert len(angles) == 24 and np.all(np.diff(angles) > 0)
    assert np.allclose(values, np.cos(np.radians(angles)), atol=1e-2)
    assert np.allclose(tangential.get_ydata(), 0.0, atol=1e-2)


# Pictures of thresholds and of judged cases, from loads made up so that statics knows the answer.


FLOW_OF_CONTACTS, COUPLE_OF_CONTACTS, WEIGHT_OF_CONTACTS = (
    np.array([1.0, 0.5, 0.0]),
    np.array([0.0, 0.0, -0.15]),
    np.array([0.0, -13.0, 0.0]),
)
MASS_AND_INERTIA = 1.0, 0.1 * np.eye(3)
BOX = np.array([[-0.5, -0.4, 0.0], [0.5, -0.4, 0.0], [0.5, 0.4, 0.0], [-0.5, 0.4, 0.0]])


def found(directory, overrides, flow=FLOW_OF_CONTACTS, factor=None):
    """A threshold as the search would leave it, for a flow whose load grows in proportion."""
    scene = load(SCENES / "grain_on_bed.toml", overrides)
    contacts = touching(scene.grain, scene.placement, scene.bed_shape, scene.contact_tolerance)
    centre = np.array([*scene.placement.centre, 0.0])
    safety = safety_factor(
        Load(flow, COUPLE_OF_CONTACTS, WEIGHT_OF_CONTACTS, centre), contacts, scene.contact.friction
    )
    share = safety.value if np.isfinite(safety.value) and safety.value > 0.0 else 1.0
    critical = Load(share * flow, share * COUPLE_OF_CONTACTS, WEIGHT_OF_CONTACTS, centre)
    verdict = judge(critical, contacts, scene.contact.friction, (2.0, np.eye(3)))
    stored = {
        "factor": safety.value if factor is None else factor,
        "sentence": "none, for a reason",
        "ranges": {"factor": [2.5, 2.9], "shields": None, "reynolds": [50.0, None]}
        | {"shear_reynolds": [7.0, 8.0]},
        "shields": 0.01,
        "reynolds": 55.0,
        "shear_reynolds": 7.4,
        "mode": "pivoting",
        "verdict": verdict.to_dict(),
        "load": asdict(critical),
        "contacts": {
            "points": contacts.points,
            "normals": contacts.normals,
            "areas": contacts.areas,
        },
        "trials": [{"factor": 1.0, "safety_factor": safety.value}],
    }
    save(scene, directory / "scene.toml")
    write_json(directory / "threshold.json", stored)
    return directory


def judged_case(directory, name, *overrides, shaped=True):
    path = CASES / f"{name}.toml"
    few = ("errors.samples=20",) if "[errors]" in path.read_text() else ()
    said = cases.judge_case(cases.load_case(path, (*few, *overrides)))
    if not shaped:
        del said["case"]
    write_json(directory / "judgement.json", said)
    return directory


# -- thresholds and cases ----------------------------------------------------------------------------------


@pytest.mark.parametrize("overrides", [POCKET, [], (*POCKET, "contact.friction=5.0")])
def test_thresholds_are_drawn_and_why_there_is_none_is_said(tmp_path, overrides):
    """A disc on a plane rolls in any flow; friction wedges one in a pocket in all flows."""
    directory = found(tmp_path, overrides)
    (written,) = draw(directory)
    assert written.name == "threshold.png"
    assert_is_a_picture(written)
    stored = json.loads((directory / "threshold.json").read_text())
    assert texts_of(of_threshold(stored, directory))[0] == "Threshold: none, for a reason."
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
def test_damaged_results_are_named(tmp_path, results, damage, complaint, request):
    if results == "run":
        request.getfixturevalue("grain_run")
    elif results == "threshold":
        found(tmp_path, POCKET)
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
    contacts = Contacts(BOX, np.tile([0.0, 0.0, -1.0], (4, 1)), np.full(4, 0.2))
    acting = Load([pushed, 0.0, 0.0], np.zeros(3), [0.0, 0.0, -1.0], [0.0, 0.0, 0.3])
    case = judged(plain(judge(acting, contacts, 0.5, inert).to_dict()))
    forces, moves = case.forces, acceleration is not None
    assert set(case.states) <= states and case.share == pytest.approx(share, rel=1e-6)
    assert (case.motion is not None) is moves and case.friction == 0.5
    if moves:
        assert np.allclose(case.motion.acceleration, acceleration, atol=1e-6)
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
    return {"velocity": velocity, "pressure": 0.5 * np.cos(a) * np.cos(b), "vorticity": curl}


def around_ellipse(time, s, t):
    """From the ellipse at a time (t = 0) to the box's boundary (t = 1)."""
    x, y, turned = course([time])[0, :3]
    angle, size = 2 * np.pi * s, np.array(SEMI_AXES)[:, None]
    outwards = np.array([np.cos(angle), np.sin(angle)])
    own = size * np.array([np.cos(angle - turned), np.sin(angle - turned)])
    (ahead, across), half = rotated(turned), np.array([[LENGTH / 2], [HEIGHT / 2]])
    inner = np.array([[x], [y]]) + np.array([[ahead, -across], [across, ahead]]) @ own
    outer = half * (1.0 + outwards / np.abs(outwards).max(axis=0))
    return ((1 - t) * inner + t * outer).T


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    directory, columns = tmp_path_factory.mktemp("moving"), 32
    write_texts(directory)
    write_history(directory / "history.csv", np.linspace(0.0, PERIOD, 101)[1:])
    edges = inner_edges(columns)
    kinds = {"fields": "Triangle_6", "surface": "Edge_3"}
    fields, surface = (SeriesFile(directory / stem, kind) for stem, kind in kinds.items())
    for file in (fields, surface):
        file.begin()
    for time in np.linspace(0.0, PERIOD, STEPS + 1)[1:]:
        points, cells = quadratic_grid(partial(around_ellipse, time), columns, 8, closed=True)
        values = vortex(points)
        for file, topology, shown in (
            (fields, cells, values),
            (surface, edges, {"traction": values["velocity"]}),
        ):
            file.add_step(time, shown, {"topology": topology, "geometry": spatial(points)})
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


def assert_is_an_animation(path):
    """A small GIF with a frame for each step, in which something moves."""
    image = Image.open(path)
    assert image.format == "GIF" and image.n_frames == STEPS
    assert path.stat().st_size < STEPS * 40_000  # with arrows 37 kB a frame, so that 200 take 7 MB
    frames = []
    for number in range(STEPS):
        image.seek(number)
        frames.append(np.asarray(image.convert("RGB")).astype(int))
    assert all((one != other).any(axis=2).mean() > 0.005 for one, other in pairwise(frames))


def test_the_grain_is_where_its_mesh_is(run):
    indices, moments = films._frames(run / "fields")
    film = films._Film(run, films.FIELDS["velocity"], indices, moments)
    for number in (0, STEPS // 2, STEPS - 1):
        film.show(number)
        (axes, *_) = film.figure.axes
        body = min(
            (p for p in axes.patches if isinstance(p, Polygon)), key=lambda p: np.ptp(p.get_xy())
        )
        expected = course([moments[number]])[0]
        middle = (body.get_xy().max(axis=0) + body.get_xy().min(axis=0)) / 2
        assert np.allclose(middle, expected[:2], atol=5e-3)
        (spoke,) = [line for line in axes.lines if line.get_marker() == "o"]
        assert np.allclose(axes.lines[-1].get_xydata()[-1], expected[:2], atol=5e-3)
        arm = np.diff(spoke.get_xydata(), axis=0)[0]
        assert np.allclose(arm, 0.5 * rotated(expected[2]), atol=3e-2)
        assert f"t = {moments[number]:.2f}" in axes.get_title(loc="left")


def rotated(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def write_rest(directory, times):
    """Fluid at rest in one cell."""
    points = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    zero = np.zeros(6)
    values = {"velocity": np.zeros((6, 3)), "pressure": zero, "vorticity": zero}
    steps = ((time, values) for time in times)
    write_series(directory / "fields", (points, np.arange(6)[None]), *steps)


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
    """Also with the directory after the options; a film has a frame for each step."""
    done = command("show", "--animate", *(run / one if "." in one else one for one in options), run)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{run / name}\n", "")
    assert_is_an_animation(run / name)


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
