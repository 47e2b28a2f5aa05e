"""What pictures show: words that stand apart, the plane through a run, contact forces, error bars."""

from __future__ import annotations

import math
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, PathPatch, Polygon
from matplotlib.text import Text

from incipient.contact import Contacts, Load
from incipient.contact.friction import FrictionCone
from incipient.contact.verdict import judge
from incipient.errors import OutputError
from incipient.files import plain
from incipient.flumes import flume
from incipient.geometry.space.beds import Plane
from incipient.geometry.space.grains import Sphere
from incipient.output.series_file import StoredStep
from incipient.pictures import style, sweep
from incipient.pictures.drawing import Sight, render
from incipient.pictures.flow import PRESSURE, mesh, picture
from incipient.pictures.plane import grain_lines, region_within
from incipient.pictures.record import StoredRun
from incipient.pictures.searches import entrainment
from incipient.pictures.trajectory import contact_forces
from incipient.pictures.verdict import of_judgement
from incipient.scene import Domain, Ellipsoid, Fluid, Scene, Shear, Time, loads

# -- words -----------------------------------------------------------------------------------------------

LONG = "A scanned pebble on a random bed of spheres, with bed.slope=3.0, with contact.friction=0.35, with bed.seed=4"
WITHOUT_BLANKS = "WIDE_LETTERS=" + "W" * 120


def boxes(figure: Figure) -> list:
    """Where each text of a figure stands, in pixels."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    axes_titles = [title for axes in figure.axes for title in (axes.title, axes._left_title)]
    written = [text for text in (*figure.texts, *axes_titles) if text.get_text()]
    return [(text.get_text(), text.get_window_extent(renderer)) for text in written]


def test_a_contact_that_lifts_against_its_cohesion_is_shown_with_its_pull() -> None:
    """A sphere torn off a plane pulls with N = -c."""
    up, zero = np.array([0.0, 0.0, 1.0]), np.zeros(3)
    contact, law = Contacts(-0.5 * up[None], -up[None]), FrictionCone.of(0.5, 0.25)
    verdict = judge(Load(4.0 * up, zero, -2.0 * up, zero), contact, law, (2.0, 0.2 * np.eye(3)))
    figure = of_judgement({"verdict": plain(verdict.to_dict())}, Path())
    words = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert words[words.index("1: lift, significant") + 1].replace("−", "-") == "-0.25"


@pytest.mark.parametrize("title", [LONG, WITHOUT_BLANKS])
def test_subject_names_and_numbers_of_a_case_in_space_do_not_overlap(title: str) -> None:
    """Numbers as of a light grain: each component takes eight letters."""
    small, normals = np.array([-1.234e-5, 2.345e-5, -3.456e-5]), np.diag([-1.0, -1.0, -1.0])
    load = Load(small, 0.1 * small, 3.0 * small, np.zeros(3))
    stored = {
        "title": title,
        "verdict": plain(judge(load, Contacts(normals, normals), 0.4).to_dict()),
    }
    with style.applied():
        figure = of_judgement(stored, Path())
        figure.draw_without_rendering()
        computed = boxes(figure)
        computed += [
            (t.get_text(), t.get_window_extent()) for t in figure.axes[1].texts if t.get_text()
        ]
    shown = "".join(figure.axes[0].get_title(loc="left").split())
    assert "".join(f"{title}; the grain is sketched".split()) in shown
    assert len(computed) > 20 and all(box.x1 <= figure.bbox.x1 for _, box in computed)
    for (words, box), (more, another) in combinations(computed, 2):
        assert not box.overlaps(another), f"{words} over {more}"


@pytest.mark.parametrize("title", [LONG, WITHOUT_BLANKS])
@pytest.mark.parametrize("view", [(0.0, 4.0, 0.0, 2.0), (0.0, 1.0, 0.0, 1.0)])
def test_titles_are_wrapped_not_cut(view: style.View, title: str) -> None:
    with style.applied():
        figure, (axes,) = style.panels([view], title)
        figure.draw_without_rendering()
        ((shown, box), *_) = boxes(figure)
    assert "".join(shown.split()) == title.replace(" ", "") and "\n" in shown
    assert (
        box.x0 >= 0.0
        and box.x1 <= figure.bbox.x1
        and box.y1 <= figure.bbox.y1
        and box.y0 > axes.bbox.y1
    )


@pytest.mark.parametrize("limits", [(0.05, 5e5), (0.06, 2e4), (200.0, 1.9e5)])
def test_labels_of_logarithmic_axes_do_not_overlap(limits: tuple[float, float]) -> None:
    with style.applied():
        figure, axes = style.chart("Shields", xscale="log", xlim=limits)
        style.number_plainly(figure)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    labels = [*axes.get_xticklabels(minor=True), *axes.get_xticklabels()]
    inside = [each for each in labels if limits[0] <= each.get_position()[0] <= limits[1]]
    boxes = [each.get_window_extent() for each in inside if each.get_text()]
    assert len(boxes) >= 3
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


def test_the_bed_of_a_grain_in_space_is_drawn() -> None:
    """Of a plane a disc of radius 1 is drawn: pi sin(17 degrees)/7.5 = 0.12 of it, a fifth behind the grain."""
    surface = Sphere(1.0).surface(0.1)
    points = surface.points + np.array([0.0, 0.0, 0.5])
    sight = Sight.of(np.array([0.2, 0.0, 0.0]), np.array([0.0, 0.0, -1.0]), np.empty((0, 3)))
    shown = {}
    for bed in (None, Plane((0.0, 0.0), 0.0)):
        axes = Figure().add_subplot(xlim=(-1.5, 1.5), ylim=(-1.0, 1.5))
        render(axes, sight, points, surface.triangles, bed)
        image = axes.images[0].get_array()
        shown[bed is None] = float((image.min(axis=2) < 250).mean())
    assert 0.08 < shown[False] - shown[True] < 0.12


def test_without_a_flow_downhill_is_to_the_right() -> None:
    """Gravity on a slope of 10 degrees that falls along x has a part along x: what it moves goes to the right."""
    still, weight = np.zeros(3), np.array([math.sin(0.1745), 0.0, -math.cos(0.1745)])
    right, upwards = Sight.of(still, weight, np.empty((0, 3)))(np.array([1.0, 0.0, 0.0]))
    assert right > 0.8
    assert upwards < 0.0


def test_marks_stand_where_the_rendering_has_what_they_mark() -> None:
    """A small sphere's image is about the place that the sight gives its centre, to a hundredth of the picture."""
    centre, surface = np.array([0.3, -0.2, 0.7]), Sphere(0.2).surface(0.02)
    sight = Sight.of(np.array([0.5, 0.1, 0.0]), np.array([0.1, 0.0, -1.0]), np.empty((0, 3)))
    axes = Figure().add_subplot(xlim=(-1.0, 2.0), ylim=(-0.5, 1.5))
    render(axes, sight, surface.points + centre, surface.triangles, None)
    shades = np.asarray(axes.images[0].get_array()).min(axis=2)
    rows, columns = shades.shape
    shades[3 * rows // 4 :, : columns // 4] = 255  # without the coordinate axes in the corner
    dark = np.argwhere(shades < 250)
    down, across = (dark.min(axis=0) + dark.max(axis=0) + 1) / 2
    place = -1.0 + 3.0 * across / columns, 1.5 - 2.0 * down / rows
    assert sight(centre) == pytest.approx(place, abs=0.02)


@pytest.mark.parametrize("title", [r"$\frac{$", "costs $5 and $6", "one $ alone", "a_1^2"])
def test_a_title_is_shown_as_it_is_written(tmp_path: Path, title: str) -> None:
    """Two $ make a formula for matplotlib, which fails or is set in italics; powers of ten are none either."""
    with style.applied():
        figure = Figure()
        figure.suptitle(title)
        axes = figure.add_subplot(title=title, xscale="log", xlabel=title)
        axes.plot([1, 2], ["$a$", "b"], label=title)
        axes.legend()
        style.save(figure, tmp_path / "x.png")
    texts = [text for text in figure.findobj(Text) if text.get_text() in (title, "$a$")]
    assert len(texts) >= 4 and not any(text.get_parse_math() for text in texts)
    axes.set_xlim(1.0, 1e3)
    assert {"1", "10", "100"} <= {label.get_text() for label in axes.get_xticklabels()}


# -- the plane -------------------------------------------------------------------------------------------

EDGES = (
    (0, 1),
    (1, 2),
    (0, 2),
    (0, 3),
    (1, 3),
    (2, 3),
)  # of a tetrahedron, in VTK's order of their nodes
CUBE = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
# Of one orientation, as meshes have them.
SIX = ((0, 4, 6, 7), (0, 5, 4, 7), (0, 6, 2, 7), (0, 2, 3, 7), (0, 1, 5, 7), (0, 3, 1, 7))


def quadratic(
    corners: np.ndarray, cells: tuple[tuple[int, ...], ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Points and cells with the middles of their edges."""
    ends = np.sort(np.array(cells)[:, EDGES].reshape(-1, 2))
    edges, numbers = np.unique(ends, axis=0, return_inverse=True)
    points = np.vstack([corners, corners[edges].mean(axis=1)])
    return points, np.hstack([cells, len(corners) + numbers.reshape(-1, len(EDGES))])


@pytest.mark.parametrize("origin", [0.0002, -0.5])
def test_fields_and_outline_are_those_of_curved_cells(origin: float) -> None:
    """A cube whose floor rises in the hump z = 1.6 x (1 - x), 0.4 in the middle: x at every point is x, none below.

    Cut in the middle and along its side, as half a scene is: no slivers, whose shading is wrong.
    """
    points, cells = quadratic(CUBE, SIX)
    points[:, 2] += 1.6 * points[:, 0] * (1.0 - points[:, 0]) * (1.0 - points[:, 2])
    fields = {"pressure": points[:, 0].copy(), "velocity": points.copy()}
    domain = Domain(origin=(0.0, origin, 0.0), length=1.0, width=1.0, height=1.0)
    scene = Scene(domain=domain, flow=Shear(), fluid=Fluid(reynolds=1.0, scale="flow"))
    plane = StoredRun(Path(), {}, scene, StoredStep(0.0, points, cells, fields), None).plane
    x, z = np.meshgrid(np.linspace(0.01, 0.99, 50), np.linspace(0.01, 0.99, 50))
    corners = plane.points[plane.triangulation.triangles]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).min() > 1e-4
    computed = plane.at(np.column_stack([x.ravel(), z.ravel()]), "pressure").reshape(x.shape)
    assert np.abs(computed - x).max() < 1e-6
    assert (
        computed.mask[(z < 0.3) & (np.abs(x - 0.5) < 0.1)].all()
        and not computed.mask[z > 0.6].any()
    )
    (line,) = plane.outlines
    x, z = line.T
    assert line[0] == pytest.approx(line[-1])
    assert (x.min(), x.max(), z.max()) == pytest.approx((0.0, 1.0, 1.0), abs=1e-6)
    floor = line[(x > 1e-6) & (x < 1 - 1e-6) & (z < 0.99)]
    assert len(floor) >= 4
    assert np.abs(floor[:, 1] - 1.6 * floor[:, 0] * (1.0 - floor[:, 0])).max() < 0.01


@pytest.mark.parametrize(("time", "when"), [(None, ""), (Time(end=9.0, step=0.1), " at t = 2.5")])
def test_pictures_of_unsteady_flow_say_when(time: Time | None, when: str) -> None:
    points, cells = quadratic(CUBE, SIX)
    scene = Scene(
        domain=Domain(length=1.0, width=1.0, height=1.0),
        flow=Shear(),
        fluid=Fluid(reynolds=1.0, scale="flow"),
        time=time,
    )
    fields = {"pressure": points[:, 0].copy(), "velocity": points.copy()}
    run = StoredRun(Path(), {}, scene, StoredStep(2.5, points, cells, fields), None)
    for figure in (picture(run, PRESSURE), mesh(run)):
        words, _ = boxes(figure)[0]
        assert words.endswith(f"scale of the flow){when}")


def test_the_line_around_a_grain_is_its_own() -> None:
    """An ellipsoid turned about y: every point of the line is on it, to 1e-3 of its size."""
    scene = Scene(
        domain=Domain(length=4.0, width=2.0, height=2.0),
        flow=Shear(),
        fluid=Fluid(reynolds=1.0, scale="grain"),
        body=Ellipsoid(semi_axes=(0.6, 0.4, 0.3), centre=(2.0, 1.0, 1.0)),
    )
    turned = [np.cos(0.3), 0.0, np.sin(0.3), 0.0]
    result = {"grain": {"computed_centre": [2.0, 1.0, 1.0], "quaternion": turned}}
    without_cells = StoredStep(0.0, CUBE, np.zeros((0, 10), int), {})
    (line,) = grain_lines(StoredRun(Path(), result, scene, without_cells, None), 1.0)
    turn = np.array([[np.cos(0.6), np.sin(0.6)], [-np.sin(0.6), np.cos(0.6)]])
    x, z = turn.T @ (line - [2.0, 1.0]).T
    assert len(line) > 200
    assert np.abs(np.hypot(x / 0.6, z / 0.3) - 1.0).max() < 5e-3


@pytest.mark.parametrize("ways", [(1, 1, 1), (1, -1, 1), (-1, -1, 1)])
def test_holes_of_a_grain_are_not_painted(ways: tuple[int, int, int]) -> None:
    """A ring and a disc in its hole, whichever way round their lines run: rings are in the region, gaps are not."""
    angle = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    lines = [r * circle[::way] for r, way in zip((30.0, 20.0, 10.0), ways, strict=True)]
    figure = Figure((1.0, 1.0), dpi=80)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(-40, 40), ylim=(-40, 40))
    axes.add_artist(PathPatch(region_within(lines), color="black"))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    painted = np.asarray(canvas.buffer_rgba())[40, [42, 55, 65, 75], 0] < 128
    assert painted.tolist() == [True, False, True, False]


# -- contacts of a moving grain --------------------------------------------------------------------------

SCENE = """
[domain]
length = 4.0
height = 2.0
[fluid]
reynolds = 10.0
scale = "grain"
[flow]
kind = "shear"
rate = 1.0
[bed]
kind = "flat"
[body]
shape = "disc"
diameter = 1.0
x = 2.0
density = 2.0
motion = "released"
[gravity]
acceleration = 1.0
[contact]
friction = 1.0
kinetic_friction = 0.5
[time]
end = 1.0
step = 0.1
"""
ROWS = """time,contact,x,y,normal_x,normal_y,force_x,force_y,slip
0.1,0,2.0,0.01,0.0,1.0,0.2,2.0,0.0
0.2,0,2.1,0.01,0.0,1.0,-0.5,1.0,0.3
0.2,1,2.4,0.01,0.0,1.0,0.0,0.0,0.0
"""


def opening(cone: Polygon, point: tuple[float, float]) -> tuple[float, float]:
    """Least and largest direction [degrees] of a cone's corners from its point."""
    arms = cone.get_xy() - point
    arms = arms[np.linalg.norm(arms, axis=1) > 1e-9]
    directions = np.degrees(np.arctan2(*arms.T[::-1]))
    return directions.min(), directions.max()


def test_contacts_are_drawn_with_cones_of_their_friction_and_forces_to_one_scale(
    tmp_path: Path,
) -> None:
    """A contact that sticks has 45 degrees to either side, one that slides the arc tangent of 0.5."""
    (tmp_path / "contacts.csv").write_text(ROWS)
    computed, axes = contact_forces(tmp_path, loads(SCENE).contact), Figure().add_subplot()
    cone, arrow = computed.draw(axes, 0.1, 1.0)
    assert isinstance(arrow, FancyArrowPatch)
    assert opening(cone, (2.0, 0.01)) == pytest.approx((45.0, 135.0))
    sliding, pushed, idle = computed.draw(axes, 0.2, 1.0)
    half = np.degrees(np.arctan(0.5))
    assert opening(sliding, (2.1, 0.01)) == pytest.approx((90.0 - half, 90.0 + half))
    lengths = [np.linalg.norm(np.subtract(*one._posA_posB)) for one in (arrow, pushed)]
    assert lengths[1] / lengths[0] == pytest.approx(np.hypot(0.5, 1.0) / np.hypot(0.2, 2.0))
    assert opening(idle, (2.4, 0.01)) == pytest.approx((45.0, 135.0))
    assert computed.draw(axes, 0.3, 1.0) == [] and len(computed.draw(axes, 0.25, 1.0, 0.1)) == 3


def test_what_is_not_there_is_not_drawn_and_what_is_damaged_is_refused(tmp_path: Path) -> None:
    assert contact_forces(tmp_path, loads(SCENE).contact) is None
    (tmp_path / "contacts.csv").write_text(ROWS.replace("2.4", "here"))
    with pytest.raises(OutputError, match=r"contacts\.csv: cannot be read"):
        contact_forces(tmp_path, loads(SCENE).contact)


# -- entrainment -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "told"), [(0.001, "all errors"), (None, "known errors, without those of the flow")]
)
def test_bars_without_the_error_of_the_flow_are_not_said_to_hold_all(
    error: float | None, told: str
) -> None:
    stored = {
        "title": "",
        "threshold": {"shields": 0.01},
        "curve": [
            {"shields": x, "probability": 10.0 * x, "low": 9.0 * x, "high": 11.0 * x}
            for x in (0.01, 0.02)
        ],
        "quantiles": [
            {
                "shields": 0.01,
                "probability": 0.1,
                "terms": {"law of fluctuations": 0.001},
                "error": error,
            }
        ],
        "data": [],
    }
    words = [
        text.get_text() for text in entrainment(stored, Path()).axes[0].get_legend().get_texts()
    ]
    assert {f"band: {told}", f"bars: {told}"} <= set(words)


def test_curves_break_at_infinite_factors_and_say_how_many_they_are() -> None:
    cases = [
        {"source": "x", "a": a, "safety_factor": factor}
        for a, factor in ((1.0, 2.0), (4.0, 3.0), (2.0, math.inf), (3.0, math.inf))
    ]
    figure = sweep._curves(cases, "safety_factor", "a", None, Path())
    assert figure.get_supxlabel() == "Infinite, so not drawn: 2 of 4 cases"
    curve = figure.axes[0].lines[0].get_ydata()
    np.testing.assert_array_equal(curve, [2.0, np.nan, np.nan, 3.0])


def test_each_curve_and_band_of_shields_diagram_is_in_its_legend(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drawn: list[Figure] = []
    monkeypatch.setattr(style, "save", lambda figure, path: drawn.append(figure))
    answer = flume(2e-3, depth=0.1, slope=0.1)
    sweep.draw_flume(answer, Path("shields.png"))
    (axes,) = drawn[0].axes
    labels = axes.get_legend_handles_labels()[1]
    assert len(labels) == len([*axes.lines, *axes.collections]) == 6
    # Curves are those of level beds.
    assert axes.lines[-1].get_ydata() == [answer.shields / answer.slope_factor]
    assert "this flume, divided by 0.84 for its slope" in labels


def test_a_map_marks_modes_and_has_the_boundary_of_motion_in_the_middle_of_its_colours() -> None:
    """A safety factor of 4 and one of 1/2 span 1/4 to 4; a factor of zero has no colour."""
    cases = [
        {"source": "x", "a": a, "b": b, "mode": mode, "safety_factor": factor}
        for a, b, mode, factor in (
            (1.0, 0.2, "rest", 4.0),
            (2.0, 0.3, "rolling", 0.5),
            (2.0, 0.2, "rolling", 0.0),
        )
    ]
    rest, rolling = sweep._map(cases, "a", "b", Path()).axes[0].collections
    assert (rest.get_label(), rolling.get_label()) == ("rest", "rolling")
    assert (rest.norm.vmin, rest.norm.vmax, rest.norm(1.0)) == pytest.approx((0.25, 4.0, 0.5))
    assert rolling.get_offsets().tolist() == [[2.0, 0.3], [2.0, 0.2]]
