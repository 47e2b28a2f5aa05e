"""Drawing a judged 2-D grain: contact forces in their friction cones, the load, how it begins to move."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Patch, Polygon, Wedge
from matplotlib.path import Path
from matplotlib.patheffects import Normal, Stroke

from ..arrays import quarter_turned, spatial
from .judged import BEYOND, MOVED, SHORTEST_CONE, SMALL, STRONGEST, DrawnMotion, Judged
from .style import FLOW, FORCES, GRAIN, GROUND, INK, MOTION, PAPER, REACTION, STATES, Looks, View

# Lengths in grain sizes.
_NORMAL = 0.24  # dashed normal into the bed
_ACCELERATION, _COUPLE = 0.42, 0.2  # arrow of the acceleration, radius of the torque's arc
_ARC = 36.0  # half of an arc that shows the sense of turning, degrees
_STRIP = (0.26, 0.055)  # half a strip of bed at a contact, and its thickness

Marks = list[tuple[Artist, str]]
Forces = dict[str, np.ndarray]  # (3,) by name


def show_place(axes: Axes, points: np.ndarray, size: float, above: float = 0.55) -> View:
    """Make the axes show points (n, 2) true to scale, with room above [grain sizes] and for arrows below."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    y0, y1 = min(low[1] - 0.62 * size, middle[1] - size), high[1] + above * size
    half = (y1 - y0) * axes.bbox.width / axes.bbox.height / 2
    view = (middle[0] - half, middle[0] + half, y0, y1)
    axes.set(xlim=view[:2], ylim=view[2:], xlabel="x [scene units]", ylabel="y [scene units]")
    return view


def draw_grain(axes: Axes, outline: np.ndarray, known: bool = True) -> None:
    """The grain; dashed if its outline (n, 2) is only a sketch."""
    style = "-" if known else (0, (4, 3))
    axes.add_artist(Polygon(outline, facecolor=GRAIN, edgecolor=INK, lw=1.2, ls=style, zorder=4))


def draw_bed(axes: Axes, line: np.ndarray) -> None:
    """The bed along a line (n, 2) from left to right, with the ground below it."""
    low = axes.get_ylim()[0] - 1.0
    ground = np.vstack([line, [line[-1, 0], low], [line[0, 0], low]])
    axes.add_artist(Polygon(ground, facecolor=GROUND, lw=0, zorder=0))
    axes.add_artist(Line2D(*line.T, color=INK, lw=0.8, zorder=3))


def draw_strips(axes: Axes, case: Judged, size: float) -> None:
    """Strips of bed along the surface at the contacts, where no more of it is known."""
    points, normals = case.contacts.points[:, :2], case.contacts.normals[:, :2]
    for group in [*case.patches, *([index] for index in range(len(points)))]:
        normal = normals[group[0]]
        along, into = quarter_turned(normal), _STRIP[1] * size * normal
        reach = points[group] @ along
        ends = reach.min() - _STRIP[0] * size, reach.max() + _STRIP[0] * size
        start, end = (points[group[0]] + (at - reach[0]) * along for at in ends)
        axes.add_artist(
            Polygon([start, end, end + into, start + into], facecolor=GROUND, lw=0, zorder=2)
        )
        axes.add_artist(Line2D(*np.array([start, end]).T, color=INK, lw=1.0, zorder=3))


def draw_case(axes: Axes, case: Judged, outline: np.ndarray, size: float) -> Marks:
    """Everything but grain and bed; returns the marks to be explained."""
    scale = STRONGEST * size / case.largest
    _draw_cones(axes, case, scale, size)
    for group in case.patches:  # contacts that have an area, given by their ends, as broad lines
        ends = case.contacts.points[group, :2]
        axes.plot(*ends.T, color=INK, lw=5, alpha=0.35, solid_capstyle="butt", zorder=5.5)
    points, normals = case.contacts.points[:, :2], case.contacts.normals[:, :2]
    mark_contacts(
        axes, points, normals, case.significant, [STATES[one][0] for one in case.states], size
    )
    centre = case.load.centre[:2]
    if case.motion is not None:
        _draw_motion(axes, case.motion, centre, outline, size)
    draw_load(axes, centre, size, case.acting, case.load.flow_couple, case.largest)
    return marks_of(case)


def draw_load(
    axes: Axes, centre: np.ndarray, size: float, forces: Forces, couple: np.ndarray, largest: float
) -> None:
    """Forces from the centre, to one scale, and an arc in the sense of the torque about it."""
    if abs(turning := float(couple[2])) > 1e-3 * size * np.linalg.norm(forces["flow"]):
        _turning(axes, centre, _COUPLE * size, int(np.sign(turning)), FLOW, 1.3)
    visible = {
        k: f[:2] for k, f in forces.items() if largest and np.linalg.norm(f) > SMALL * largest
    }
    for name, force in visible.items():
        colour, along = FORCES[name], force / np.linalg.norm(force)
        tip = centre + STRONGEST * size * force / largest
        arrow(axes, centre, tip, colour, 2.2 if name == "resultant" else 1.8)
        others = [other for key, other in visible.items() if key != name]
        label(axes, tip + 0.05 * size * along, along + aside(along, others), name, colour)
    axes.plot(*centre, "o", color=INK, ms=3.5, zorder=9)


def arrow(
    axes: Axes, tail: np.ndarray, tip: np.ndarray, colour: str, width: float, zorder: float = 7
) -> None:
    """A straight arrow; the head of a short one is smaller."""
    ends = axes.transData.transform([tail, tip])
    length = float(np.linalg.norm(ends[1] - ends[0])) * 72 / axes.figure.dpi  # points
    axes.add_artist(FancyArrowPatch(
        tuple(tail), tuple(tip), arrowstyle="-|>", mutation_scale=min(13.0, 0.8 * length + 3),
        color=colour, lw=width, shrinkA=0, shrinkB=0, zorder=zorder, joinstyle="miter",
        path_effects=[Stroke(linewidth=width + 1.2, foreground="white", alpha=0.7), Normal()],
    ))  # fmt: skip


def label(
    axes: Axes, place: np.ndarray, direction: np.ndarray, text: str, colour: str, points: float = 9
) -> None:
    """Text that leads away from a place in a direction, so that it does not cover what ends there."""
    across, up = direction / np.linalg.norm(direction)
    beside = "left" if across > 0.35 else "right" if across < -0.35 else "center"
    above = "bottom" if up > 0.8 else "top" if up < -0.8 else "center"
    looks: Looks = {"ha": beside, "va": above, "fontsize": points, "zorder": 10, "bbox": PAPER}
    axes.text(place[0], place[1], text, color=colour, **looks)


def mark_contacts(
    axes: Axes,
    points: np.ndarray,
    normals: np.ndarray,
    significant: Sequence[int],
    colours: Iterable[str],
    size: float,
) -> None:
    """Contact points (n, 2) with normals into the bed; the significant reaction surface is ringed."""
    for index, (point, normal, colour) in enumerate(zip(points, normals, colours, strict=True)):
        stands_out = index in significant
        end = point + _NORMAL * size * normal
        ends = np.array([point, end]).T
        axes.plot(*ends, "--", color=REACTION if stands_out else colour, lw=1.1, zorder=6)
        if stands_out:
            axes.plot(*point, "o", color="white", ms=11, mec=REACTION, mew=2.2, zorder=8)
        axes.plot(*point, "o", color=colour, ms=5.5, mec="white", mew=0.7, zorder=9)
        if len(points) > 1:
            label(axes, end + 0.02 * size * normal, normal, f"{index + 1}", INK, 7.5)


def _draw_cones(axes: Axes, case: Judged, scale: float, size: float) -> None:
    """Draw the friction cone at each contact, and in it the force."""
    opening = np.degrees(case.cone_angle)
    for point, normal, force, state in _rows(case):
        colour = STATES[state][0]
        reach = max(SHORTEST_CONE * size, BEYOND * scale * float(np.linalg.norm(force)))
        middle = np.degrees(np.arctan2(*-normal[::-1]))
        ends = middle - opening, middle + opening
        axes.add_artist(
            Wedge(tuple(point), reach, *ends, facecolor=colour, alpha=0.17, lw=0, zorder=5)
        )
        for angle in np.radians(ends):
            far = point + reach * np.array([np.cos(angle), np.sin(angle)])
            axes.plot(*np.array([point, far]).T, color=colour, lw=0.8, alpha=0.8, zorder=5)
        if force.any():
            arrow(axes, point, point + scale * force, colour, 2.4, zorder=7.5)


def _draw_motion(
    axes: Axes, motion: DrawnMotion, centre: np.ndarray, outline: np.ndarray, size: float
) -> None:
    """The grain a little later, dashed; the acceleration of its centre; the sense in which it turns."""
    arms = spatial(outline - centre)
    fastest = float(np.linalg.norm(motion.at(arms), axis=1).max()) or 1.0
    later = outline + MOVED * size / fastest * motion.at(arms)[:, :2]
    axes.add_artist(
        Polygon(later, fill=False, edgecolor=MOTION, lw=1.1, ls=(0, (4, 2.5)), zorder=4.5)
    )
    speed = float(np.linalg.norm(motion.acceleration))
    if speed > 1e-6 * fastest:
        tip = centre + _ACCELERATION * size * motion.acceleration[:2] / speed
        axes.add_artist(FancyArrowPatch(
            tuple(centre), tuple(tip), arrowstyle="simple,tail_width=5,head_width=14,head_length=11",
            facecolor=MOTION, edgecolor="white", lw=0.9, shrinkA=0, shrinkB=0, zorder=6.8,
        ))  # fmt: skip
    turning = float(motion.angular[2])
    if abs(turning) * size > 1e-6 * fastest:
        _turning(axes, centre, _outside(outline, centre, size), int(np.sign(turning)), MOTION, 2.4)


def _outside(outline: np.ndarray, centre: np.ndarray, size: float) -> float:
    """A radius just outside the part of an outline above the centre."""
    arms = outline - centre
    lengths = np.linalg.norm(arms, axis=1)
    above = lengths[arms[:, 1] > np.cos(np.radians(_ARC)) * lengths]
    return float((above if len(above) else lengths).max()) + 0.1 * size


def _turning(
    axes: Axes, centre: np.ndarray, radius: float, sense: int, colour: str, width: float
) -> None:
    """An arc above the centre with a head; counter-clockwise for a positive sense."""
    angles = np.radians(90 + sense * np.linspace(-_ARC, _ARC, 40))
    points = centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])
    looks: Looks = {
        "mutation_scale": 6 + 3.5 * width,
        "color": colour,
        "lw": width,
        "fill": False,
        "zorder": 7,
    }
    axes.add_artist(FancyArrowPatch(path=Path(points), arrowstyle="-|>", **looks))


def aside(along: np.ndarray, others: list[np.ndarray]) -> np.ndarray:
    """Unit vector across an arrow's direction, away from another that runs close to it; zero if none does."""
    across = quarter_turned(along)
    close = [f for f in others if along @ f > 0.8 * np.linalg.norm(f)]
    return -np.sign(across @ close[0]) * across if close else np.zeros(2)


def _rows(case: Judged) -> Iterable[tuple[np.ndarray, np.ndarray, np.ndarray, str]]:
    """Point, normal, force (2,) and state of each contact."""
    columns = (
        case.contacts.points[:, :2],
        case.contacts.normals[:, :2],
        case.forces[:, :2],
        case.states,
    )
    return zip(*columns, strict=True)


def marks_of(case: Judged) -> Marks:
    """What the marks of a case mean."""
    states = [STATES[state] for state in dict.fromkeys(case.states)]
    marks: Marks = [
        (Line2D([], [], color=colour, lw=2.4), f"contact {words}") for colour, words in states
    ]
    opening = f"friction cone, {np.degrees(case.cone_angle):.3g}° to either side of the normal"
    marks.append((Patch(facecolor="#55555533", edgecolor="#555555", lw=0.8), opening))
    if case.forces.any():
        marks.append((Line2D([], [], color="#555555", lw=2.4, marker=">", ms=6), case.occasion))
    if case.significant:
        ring = Line2D([], [], color=REACTION, ls="--", lw=1.1, marker="o", ms=9, mfc="white", mew=2)
        marks.append((ring, "significant reaction surface of the paper's criteria"))
    if case.motion is not None:
        mark = Line2D([], [], color=MOTION, lw=4)
        marks.append((mark, "acceleration of the centre, sense of turning, outline a little later"))
    return marks
