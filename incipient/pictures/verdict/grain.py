"""Pictures of the grain: the traction on its surface, and the verdict with the forces behind it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ...arrays import planar_cross, quarter_turned
from ...output.series_file import StoredStep
from ..flow.fields import draw_solids, draw_streamlines
from ..flow.mesh import directed, enclosed_area
from ..record import StoredRun
from ..style import INK, PAPER, PULL, PUSH, View
from .judged import Judged, judged
from .plane import Marks, arrow, draw_case, draw_grain, draw_load, mark_contacts, show_place
from .sheet import Group, explain, judge_rows, load_rows, sheet, write_numbers

_ARROWS = 64
_LONGEST = 0.75  # arrow of a traction, in grain sizes
_COEFFICIENTS = ("drag", "lift", "moment")
_CLOSED, _GAP = "Closed where narrower than", "Gap that stands for contact"
_UNIT = "[scene units]"
_UNASKED = ("The forces on the grain; the scene asks for no verdict.", "")


@dataclass(frozen=True)
class GrainSurface:
    """Points, unit normals out of the grain and tractions, (n, 2) each, anticlockwise around the grain.

    is_closed: whether they go all round; else no flow reaches the grain between the last point and the first
    """

    points: np.ndarray
    normals: np.ndarray
    tractions: np.ndarray
    is_closed: bool = True

    @classmethod
    def of(cls, step: StoredStep) -> GrainSurface:
        """Put the edges of a surface series in order around the grain."""
        points = step.points[:, :2]
        edges = directed(step.cells)
        if enclosed_area(points, edges) < 0:
            edges = edges[::-1][:, [1, 0, 2]]
        is_closed = bool(edges[-1, 1] == edges[0, 0])
        nodes = np.append(edges[:, [0, 2]].ravel(), [] if is_closed else edges[-1:, 1]).astype(int)
        normals = -quarter_turned(_tangents(points, edges, is_closed))
        return cls(points[nodes], normals, step.fields["traction"][nodes, :2], is_closed)

    @property
    def size(self) -> float:
        """Largest extent along an axis."""
        return float(np.ptp(self.points, axis=0).max())

    @property
    def normal_part(self) -> np.ndarray:
        """(n,) traction along the outward normal; negative where the grain is pressed."""
        return np.sum(self.tractions * self.normals, axis=1)

    @property
    def tangential_part(self) -> np.ndarray:
        """(n,) traction along the surface, positive anticlockwise."""
        return planar_cross(self.normals, self.tractions)

    def spaced(self, count: int) -> np.ndarray:
        """Indices of at most `count` points, at about equal distances along the surface."""
        steps = np.linalg.norm(np.diff(self.points, axis=0, append=self.points[:1]), axis=1)
        reached = np.cumsum(steps) - steps
        wanted = np.arange(count) * steps.sum() / count
        return np.unique(np.minimum(np.searchsorted(reached, wanted), len(reached) - 1))

    def angles(self, centre: np.ndarray) -> np.ndarray:
        """(n,) directions of the points from a centre, degrees from 0 to 360, anticlockwise from +x."""
        across, up = (self.points - centre).T
        return np.degrees(np.arctan2(up, across)) % 360


def traction(run: StoredRun) -> Figure:
    """Arrows of the traction on the grain's surface, and its components around the grain."""
    surface = _surface(run)
    figure = Figure(figsize=(9.4, 4.7))
    figure.text(
        0.07, 0.965, f"{run.title}: traction of the fluid on the grain", fontsize=11, va="top"
    )
    _show_arrows(run, figure.add_axes((0.07, 0.11, 0.44, 0.73)), surface)
    _show_components(run, figure.add_axes((0.61, 0.11, 0.37, 0.73)), surface)
    return figure


def verdict(run: StoredRun) -> Figure:
    """The grain on its bed with contacts, forces and couple; the verdict in words; the numbers behind it."""
    surface = _surface(run)
    figure, axes, case = sheet_of(run)
    view = _show_place(run, axes, surface)
    draw_streamlines(run, axes, view, color="#9db8cf", alpha=0.55)
    # The flow was computed with a gap; the grain is judged where it touches, and shown there.
    outline = _outline(run, surface) + _settled(run)
    draw_grain(axes, outline)
    if case is None:
        explain(axes, _draw_unjudged(run, axes, surface))
    else:
        explain(axes, draw_case(axes, case, outline, surface.size))
    write_numbers(axes, [*judged_numbers(run, case, planar=True), *_numbers(run)])
    return figure


def sheet_of(run: StoredRun) -> tuple[Figure, Axes, Judged | None]:
    """The sheet of a run's verdict with its sentences, where the grain is drawn, and what was judged."""
    stored = run.result.get("verdict")
    case = None if stored is None else judged(stored, run.directory / "result.json")
    return *sheet(*(_UNASKED if case is None else case.sentences), run.headline), case


def _surface(run: StoredRun) -> GrainSurface:
    if run.surface is None:
        raise ValueError("a run without a grain has no picture of it")
    return GrainSurface.of(run.surface)


def _outline(run: StoredRun, surface: GrainSurface) -> np.ndarray:
    """Points (n, 2) around the grain: those of its surface that the flow reaches, or all where contacts are closed."""
    return surface.points if run.touching_grain is None else run.touching_grain


def _show_place(run: StoredRun, axes: Axes, surface: GrainSurface, above: float = 0.55) -> View:
    """Make the axes show the grain true to scale with the solids, more of the fluid than of the ground."""
    view = show_place(axes, surface.points, surface.size, above)
    draw_solids(run, axes, fluid_shown=False, grain_shown=False)
    return view


def _show_arrows(run: StoredRun, axes: Axes, surface: GrainSurface) -> None:
    """Pressing tractions end on the surface, pulling ones start there: all stand outside the grain."""
    view = _show_place(run, axes, surface, above=0.95)
    draw_grain(axes, _outline(run, surface))
    chosen = surface.spaced(_ARROWS)
    tractions = surface.tractions[chosen]
    strength = np.linalg.norm(tractions, axis=1)
    longest = float(np.percentile(strength, 95)) or 1.0
    shown = tractions * np.minimum(1.0, 1.3 * longest / np.maximum(strength, 1e-300))[:, None]
    pressed = surface.normal_part[chosen] < 0
    scale = longest / (_LONGEST * surface.size)
    for which, pivot, colour in ((pressed, "tip", PUSH), (~pressed, "tail", PULL)):
        axes.quiver(
            *surface.points[chosen][which].T, *shown[which].T, pivot=pivot, color=colour, angles="xy",
            scale_units="xy", scale=scale, width=0.0045, headwidth=4, headlength=5, zorder=5,
        )  # fmt: skip
    _explain_arrows(axes, view, _rounded(longest), scale)


def _explain_arrows(axes: Axes, view: View, unit: float, scale: float) -> None:
    """The two colours above the axes, and an arrow of a round length with its value in the upper left."""
    marks = [Line2D([], [], color=colour, lw=2) for colour in (PUSH, PULL)]
    labels = ["presses on the grain", "pulls at the grain"]
    axes.legend(marks, labels, loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2, ncols=2)
    x0, x1, y0, y1 = view
    tail = np.array([x0 + 0.03 * (x1 - x0), y1 - 0.05 * (y1 - y0)])
    tip = tail + np.array([unit / scale, 0.0])
    arrow(axes, tail, tip, INK, 1.4)
    axes.text(tip[0] + 0.02 * (x1 - x0), tip[1], f"{unit:g} scene units", va="center", bbox=PAPER)


def _show_components(run: StoredRun, axes: Axes, surface: GrainSurface) -> None:
    angles = surface.angles(_centre(run, surface))
    order = np.argsort(angles)
    # Where no flow reaches the grain the lines are broken: after the last point, before the first.
    last = np.flatnonzero((order[:-1] == len(order) - 1) & (order[1:] == 0))
    broken = np.empty(0, dtype=int) if surface.is_closed else last + 1
    for part, colour, label in (
        (surface.normal_part, PUSH, "along the outward normal (negative: pressed)"),
        (surface.tangential_part, PULL, "along the surface, anticlockwise"),
    ):
        lines = (np.insert(values[order], broken, np.nan) for values in (angles, part))
        axes.plot(*lines, color=colour, lw=1.3, label=label)
    axes.axhline(0, color=INK, lw=0.5)
    axes.set(xlim=(0, 360), xlabel="direction from the grain's centre [degrees]")
    axes.set_ylabel("traction [scene units]")
    axes.set_xticks([0, 90, 180, 270, 360], ["0\n+x", "90\n+y", "180\n−x", "270\n−y", "360\n+x"])
    axes.grid(color="#dddddd", lw=0.5)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2)


def _centre(run: StoredRun, surface: GrainSurface) -> np.ndarray:
    centre = run.value("grain", "centre")
    return surface.points.mean(axis=0) if centre is None else np.array(centre[:2], dtype=float)


def _rounded(value: float) -> float:
    """The largest of 1, 2, 5, 10, 20, 50... (and their thousandths) that does not exceed a value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(digit for digit in (1, 2, 5) if digit * power <= value * (1 + 1e-12)))


def _settled(run: StoredRun) -> np.ndarray:
    """The shift from where the flow was computed to where the grain touches, (2,)."""
    resting, computed = (run.value("grain", key) for key in ("centre", "computed_centre"))
    return (
        np.zeros(2) if resting is None or computed is None else np.subtract(resting, computed)[:2]
    )


def _draw_unjudged(run: StoredRun, axes: Axes, surface: GrainSurface) -> Marks:
    """The load, and the contacts if there are any."""
    forces = run.acting()
    largest = max(float(np.linalg.norm(force)) for force in forces.values())
    draw_load(
        axes, _centre(run, surface), surface.size, forces, run.space("couple", "flow"), largest
    )
    if not run.contacts:
        return []
    points, normals = (np.array(column) for column in zip(*run.contacts, strict=True))
    mark_contacts(axes, points, normals, (), [INK] * len(points), surface.size)
    return [(Line2D([], [], color=INK, ls="--", lw=1.1, marker="o"), "contact, with its normal")]


def judged_numbers(run: StoredRun, case: Judged | None, planar: bool) -> list[Group]:
    """The load in numbers and, of a judged grain, what the judges say."""
    if case is None:
        return [load_rows(run.acting(), run.space("couple", "flow"), _UNIT, planar)]
    return [load_rows(case.acting, case.load.flow_couple, _UNIT, planar), *judge_rows(case)]


def _numbers(run: StoredRun) -> list[Group]:
    """Force and couple of the flow, as far as the result and the scene hold them."""
    rows: Group = [("Flow", "", INK)]
    closed = bool(run.value("gap", "closed"))
    for name, value in (
        *(
            (f"{key.capitalize()} coefficient", run.value("coefficients", key))
            for key in _COEFFICIENTS
        ),
        ("Reynolds number", run.setting("fluid", "reynolds")),
        (_CLOSED if closed else _GAP, run.value("gap", "width")),
        *(() if closed else (("Cells across the gap", run.value("gap", "cells")),)),
        ("First motion at time", run.value("verdict", "first_motion")),
    ):
        if isinstance(value, (int, float)):
            rows.append((name, f"{value:.4g}", INK))
    return [rows] if len(rows) > 1 else []


def _tangents(points: np.ndarray, edges: np.ndarray, is_closed: bool) -> np.ndarray:
    """(2 n, 2) unit tangents at starts and middles of edges, between two their mean, and at an open curve's end."""
    start, end, middle = (points[edges[:, i]] for i in range(3))
    leaving, arriving = 4 * middle - 3 * start - end, 3 * end + start - 4 * middle
    leaving, arriving = (t / np.linalg.norm(t, axis=1)[:, None] for t in (leaving, arriving))
    before = np.roll(arriving, 1, axis=0)
    if not is_closed:
        before[0] = leaving[0]
    tangents = np.stack([leaving + before, end - start], axis=1).reshape(-1, 2)
    tangents = np.vstack([tangents, arriving[:0] if is_closed else arriving[-1:]])
    return tangents / np.linalg.norm(tangents, axis=1)[:, None]
