"""Drawing a judged grain: contact forces in friction cones, load, incipient motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch, Polygon
from matplotlib.path import Path
from matplotlib.patheffects import Normal, Stroke

from ..arrays import unit
from ..geometry.space.beds import Terrain
from .judged import Judged
from .plane import hull, pyvista_off_screen
from .style import FLOW, FORCES, GRAIN, GROUND, INK, MOTION, PAPER, REACTION, STATES

# Of the view: from across the flow, above the horizontal.
_TURNED, _RAISED = np.radians([24.0, 17.0])
# Lengths in grain sizes: arrows of the largest force and of the acceleration, the normal into the bed, the arcs of the
# torque and of the turn, how far the grain has moved, how far the bed is shown.
_STRONGEST, _ACCELERATION, _NORMAL, _TORQUE, _OUTSIDE, _MOVED = 0.8, 0.45, 0.24, 0.2, 0.6, 0.09
_BED = 1.0
_ARC = np.radians(38.0)  # half of an arc that shows the sense of turning
_GRID = (97, 97, 65)  # points at which the distance from the bed is sampled
_SHARP = 35.0  # degrees between the sides of an edge that is shown


@dataclass(frozen=True, eq=False)
class Sight:
    """Parallel projection along the last of its directions: right, up, toward the eye (3, 3)."""

    directions: np.ndarray
    planar: bool = False

    @classmethod
    def of(cls, flow: np.ndarray, weight: np.ndarray, normals: np.ndarray) -> Sight:
        """Flow, or x, to the right, weight down; without weight the contacts with normals (n, 3) are below."""
        up = unit(-weight if weight.any() else -normals.sum(axis=0))
        up = up if up.any() else np.array([0.0, 0.0, 1.0])
        ways = np.vstack([flow, np.eye(3)])
        level = ways - np.outer(ways @ up, up)
        sideways = np.linalg.norm(level, axis=1) > 1e-9 * np.linalg.norm(ways, axis=1)
        along = unit(level[np.argmax(sideways)])
        beside = np.cos(_TURNED) * np.cross(along, up) - np.sin(_TURNED) * along
        toward = np.cos(_RAISED) * beside + np.sin(_RAISED) * up
        right = unit(np.cross(up, toward))
        return cls(np.array([right, np.cross(toward, right), toward]))

    def __call__(self, places: np.ndarray) -> np.ndarray:
        """Project positions or vectors (..., 3) onto the sheet (..., 2)."""
        return np.asarray(places) @ self.directions[:2].T

    def outline(self, places: np.ndarray) -> np.ndarray:
        """Outline of a grain on the sheet, from points (n, 3) of its outline, in 3-D of its surface."""
        return self(places) if self.planar else hull(self(places))


PLANE = Sight(np.eye(3), planar=True)


def frame(axes: Axes, points: np.ndarray, size: float, above: float = 0.55) -> None:
    """Limit the axes to points (n, 2), true to scale, with space above [grain sizes] and for arrows below."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    y0, y1 = min(low[1] - 0.62 * size, middle[1] - size), high[1] + above * size
    half = 0.6 * (y1 - y0)  # six wide, five high
    axes.set(xlim=(middle[0] - half, middle[0] + half), ylim=(y0, y1), aspect="equal")
    axes.set(xlabel="x [scene units]", ylabel="y [scene units]")


def draw_grain(axes: Axes, outline: np.ndarray, known: bool = True) -> None:
    """The grain; dashed if its outline (n, 2) is a sketch."""
    axes.add_artist(Polygon(
        outline, facecolor=GRAIN, edgecolor=INK, lw=1.2, ls="-" if known else (0, (4, 3)), zorder=4
    ))  # fmt: skip


def draw_bed(axes: Axes, line: np.ndarray) -> None:
    """The bed along a line (n, 2) from left to right, with the ground below it."""
    low = axes.get_ylim()[0] - 1.0
    ground = np.vstack([line, [line[-1, 0], low], [line[0, 0], low]])
    axes.add_artist(Polygon(ground, facecolor=GROUND, lw=0, zorder=0))
    axes.add_artist(Line2D(*line.T, color=INK, lw=0.8, zorder=3))


def render(
    axes: Axes, sight: Sight, points: np.ndarray, triangles: np.ndarray, terrain: Terrain | None
) -> None:
    """Render a grain's surface, points (n, 3) and triangles (m, 3), and its bed into the axes' limits."""
    pyvista = pyvista_off_screen()
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    shape = [round(1320 * (x1 - x0) / (y1 - y0)), 1320]
    plotter = pyvista.Plotter(off_screen=True, window_size=shape, lighting="three lights")
    plotter.background_color = "white"
    plotter.render_window.SetMultiSamples(0)  # depth peeling cannot do with them
    plotter.enable_depth_peeling(6)  # translucent surfaces in the right order
    size = float(np.ptp(points, axis=0).max())
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    looks: dict[str, Any] = {
        "ambient": 0.3, "smooth_shading": True, "split_sharp_edges": True, "feature_angle": _SHARP,
    }  # fmt: skip
    if len(triangles):
        surface = pyvista.PolyData.from_regular_faces(points, triangles)
        surface = surface.compute_normals(auto_orient_normals=True, point_normals=False)
        plotter.add_mesh(surface, color=GRAIN, opacity=0.55, culling="back", **looks)
        plotter.add_silhouette(surface, color=INK, line_width=3.0, feature_angle=_SHARP)
    if terrain is not None:
        # A height over x and y would show steep sides ragged; the distance half a spacing inside keeps spheres apart.
        spacing = 2.0 * _BED * size / (_GRID[0] - 1)
        grid = pyvista.ImageData(dimensions=_GRID, spacing=3 * [spacing])
        grid.origin = middle - _BED * size
        pieces = terrain.pieces(middle[:2], 1.5 * _BED * size)
        parts = np.array_split(np.asarray(grid.points), _GRID[2])
        grid["distance"] = np.hstack([pieces.distance_estimate(p).min(axis=0) for p in parts])
        bed = grid.contour([-0.5 * spacing], scalars="distance", compute_normals=True)
        bed["away"] = np.linalg.norm(np.asarray(bed.points)[:, :2] - middle[:2], axis=1)
        bed = bed.clip_scalar(scalars="away", value=_BED * size)
        looks["split_sharp_edges"] = False
        plotter.add_mesh(bed, color=GROUND, opacity=0.3, **looks)
    plotter.add_axes(color=INK, line_width=4, viewport=(0.0, 0.0, 0.25, 0.25))
    toward = sight.directions[2]
    focus = np.array([(x0 + x1) / 2, (y0 + y1) / 2, middle @ toward]) @ sight.directions
    plotter.camera_position = [focus + 10.0 * size * toward, focus, sight.directions[1]]
    plotter.camera.parallel_projection, plotter.camera.parallel_scale = True, (y1 - y0) / 2
    plotter.reset_camera_clipping_range()
    image = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    axes.imshow(image, extent=(x0, x1, y0, y1), interpolation="antialiased", zorder=1)
    axes.set(xticks=[], yticks=[], xlabel="", ylabel="")


def draw_case(axes: Axes, case: Judged, sight: Sight, places: np.ndarray, size: float) -> None:
    """Draw contacts, load and motion; `places` (n, 3): along the grain's outline, in 3-D on its surface."""
    scale = _STRONGEST * size / case.largest
    words = f"friction cone, half-angle {np.degrees(np.arctan(case.friction)):.3g}°", case.occasion
    contacts = zip(
        case.contacts.points, case.contacts.normals, case.forces, case.states, strict=True
    )
    for index, (point, normal, force, state) in enumerate(contacts):
        colour, said = STATES[state]
        draw_contact(axes, sight, point, -normal, scale * force, case.friction, size, colour, words)
        end, line = sight(point + _NORMAL * size * normal), colour
        if index in case.significant:  # of the paper's criteria
            line, label = REACTION, "significant reaction surface of the paper"
            axes.plot(
                *sight(point), "o", label=label, color="white", mec=REACTION, ms=11, mew=2.2, zorder=8
            )  # fmt: skip
        axes.plot(*np.array([sight(point), end]).T, "--", color=line, lw=1.1, zorder=6)
        axes.plot(
            *sight(point), "o", label=f"contact {said}", color=colour, mec="white", ms=5.5, mew=0.7, zorder=9
        )  # fmt: skip
        if len(case.states) > 1:
            away = 8.0 * unit(sight(normal))
            axes.annotate(
                f"{index + 1}", tuple(end), tuple(away), textcoords="offset points", ha="center", va="center",
                fontsize=7.5, zorder=10, bbox=PAPER,
            )  # fmt: skip
    centre, torque, flow = case.load.centre, case.load.flow_couple, case.acting["flow"]
    if case.motion is not None:
        _draw_motion(axes, case.motion, sight, centre, places, size)
    if np.linalg.norm(torque) > 1e-3 * size * np.linalg.norm(flow):
        _turning(axes, sight, centre, torque, _TORQUE * size, FLOW, 1.3, "torque of the flow")
    for name, force in case.acting.items():
        if np.linalg.norm(force) > 0.03 * case.largest:  # smaller ones are left to the numbers
            arrow(axes, sight(centre), sight(centre + scale * force), FORCES[name], 2.0, name)
    axes.plot(*sight(centre), "o", color=INK, ms=3.5, zorder=9)


def draw_contact(
    axes: Axes,
    sight: Sight,
    point: np.ndarray,
    inwards: np.ndarray,
    arm: np.ndarray,
    friction: float,
    size: float,
    colour: str,
    words: tuple[str, str] = ("", ""),
) -> list[Artist]:
    """Friction cone about a normal into the grain, without friction none, and the arrow (3,) of the force if any.

    words: their labels
    """
    drawn: list[Artist] = []
    if friction:
        reach = max(0.34 * size, 1.15 * float(np.linalg.norm(arm)))
        rim = point + reach * (inwards + friction * _circle(inwards)) / np.hypot(1.0, friction)
        if not sight.planar:
            axes.plot(*sight(rim).T, color=colour, lw=0.8, alpha=0.8, zorder=5)
        around = hull(sight(np.vstack([point, rim])))
        drawn.append(axes.add_artist(Polygon(
            around, fc=to_rgba(colour, 0.17), ec=to_rgba(colour, 0.8), lw=0.8, zorder=5, label=words[0],
        )))  # fmt: skip
    if arm.any():
        drawn.append(arrow(axes, sight(point), sight(point + arm), colour, 2.4, words[1], 7.5))
    return drawn


def arrow(
    axes: Axes,
    tail: np.ndarray,
    tip: np.ndarray,
    colour: str,
    width: float,
    label: str,
    zorder: float = 7,
) -> Artist:
    """A straight arrow, with a smaller head if it is short."""
    ends = axes.transData.transform([tail, tip])
    length = float(np.linalg.norm(ends[1] - ends[0])) * 72 / axes.figure.dpi  # points
    return axes.add_artist(FancyArrowPatch(
        tuple(tail), tuple(tip), arrowstyle="-|>", mutation_scale=min(13.0, 0.8 * length + 3),
        color=colour, lw=width, shrinkA=0, shrinkB=0, zorder=zorder, joinstyle="miter", label=label,
        path_effects=[Stroke(linewidth=width + 1.2, foreground="white", alpha=0.7), Normal()],
    ))  # fmt: skip


def _draw_motion(
    axes: Axes,
    motion: np.ndarray,
    sight: Sight,
    centre: np.ndarray,
    places: np.ndarray,
    size: float,
) -> None:
    acceleration, angular = motion
    rates = acceleration + np.cross(angular, places - centre)
    fastest = float(np.linalg.norm(rates, axis=1).max()) or 1.0
    later = sight.outline(places + _MOVED * size / fastest * rates)
    axes.add_artist(Polygon(
        later, fill=False, edgecolor=MOTION, lw=1.1, ls=(0, (4, 2.5)), zorder=4.5,
        label="outline shortly afterwards",
    ))  # fmt: skip
    if np.linalg.norm(acceleration) > 1e-6 * fastest:
        tip = sight(centre + _ACCELERATION * size * unit(acceleration))
        arrow(axes, sight(centre), tip, MOTION, 5.0, "acceleration of the centre", 6.8)
    if np.linalg.norm(angular) * size > 1e-6 * fastest:
        radius, label = _OUTSIDE * size, "sense of rotation"
        _turning(axes, sight, centre, angular, radius, MOTION, 2.4, label)


def _turning(
    axes: Axes,
    sight: Sight,
    centre: np.ndarray,
    axis: np.ndarray,
    radius: float,
    colour: str,
    width: float,
    label: str,
) -> None:
    axis = unit(axis)
    # Upwards, or toward the eye if the axis is upright.
    eye = sight.directions[1 if abs(axis @ sight.directions[1]) < 0.95 else 2]
    top = unit(eye - (eye @ axis) * axis)
    angles = np.linspace(-_ARC, _ARC, 40)[:, None]
    arc = centre + radius * (np.cos(angles) * top + np.sin(angles) * np.cross(axis, top))
    axes.add_artist(FancyArrowPatch(
        path=Path(sight(arc)), color=colour, lw=width, fill=False, arrowstyle="-|>",
        mutation_scale=6 + 3.5 * width, zorder=7, label=label,
    ))  # fmt: skip


def _circle(normal: np.ndarray) -> np.ndarray:
    first = unit(np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))]))
    angles = np.linspace(0.0, 2.0 * np.pi, 73)[:, None]
    return np.cos(angles) * first + np.sin(angles) * np.cross(normal, first)
