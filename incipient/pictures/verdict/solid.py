"""Rendering of a judged grain in space through VTK: what `plane` draws, translucent, seen from the side.

The view has the weight down and the flow to the right. Only shapes are rendered; words are set by matplotlib
at the places that the rendering tells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...arrays import unit
from ...geometry.space.beds import Terrain
from ..flow.cells import pyvista_off_screen
from ..style import FLOW, FORCES, GRAIN, GROUND, INK, MOTION, REACTION, STATES
from .judged import BEYOND, MOVED, SHORTEST_CONE, SMALL, STRONGEST, DrawnMotion, Judged

PIXELS = (1590, 1320)
_TURNED, _RAISED = (
    24.0,
    17.0,
)  # of the view: from across the flow, and above the horizontal; degrees
# Lengths in grain sizes.
_THIN, _THICK = 0.012, 0.022  # radii of arrows
_PATCH = (0.2, 0.035)  # radius and thickness of a piece of bed
_PLATE = 1.25  # by how much a piece of bed under a patch is larger than it
_RING = (0.055, 0.008)
_ACCELERATION, _COUPLE = 0.5, 0.25
_BED = (0.95, 0.01)  # how far the bed is shown, and the spacing of its points
_SHARP = 35.0  # degrees between the sides of an edge that is shown
_ARC = 40.0  # half of an arc that shows the sense of turning, degrees


@dataclass(frozen=True, eq=False)
class Rendering:
    """Colours (rows, columns, 3), and where in the image [pixels from the upper left] named points are.

    `tips`: of the forces; `numbers`: where the contacts' numbers belong; `triad`: the directions of the three
    axes in the image, (3, 2), down positive.
    """

    image: np.ndarray
    centre: np.ndarray
    tips: dict[str, np.ndarray]
    numbers: list[np.ndarray]
    triad: np.ndarray


@dataclass(frozen=True, eq=False)
class CameraFrame:
    """Unit vectors of the view, its middle, and the size of the grain."""

    along: np.ndarray  # to the right
    up: np.ndarray
    centre: np.ndarray
    size: float


def rendered(
    case: Judged, points: np.ndarray, triangles: np.ndarray, terrain: Terrain | None = None
) -> Rendering:
    """Render a case with the grain's surface, points (n, 3) and triangles (m, 3), off screen. Not collective.

    Without the bed's shape pieces of it are drawn at the contacts.
    """
    pyvista, plotter = empty_stage(PIXELS)
    frame = frame_of(case, points)
    scene = Stage(pyvista, plotter, frame)
    if len(triangles):
        scene.grain(points, triangles)
    if terrain is not None:
        scene.bed(terrain)
    tips, numbers = scene.load(case), scene.contacts(case, pieces=terrain is None)
    if case.motion is not None:
        scene.motion(case.motion, points, triangles)
    scene.look(np.vstack([points, *tips.values(), *numbers]))
    image = plotter.screenshot(return_img=True)
    centre = scene.pixel(frame.centre)
    triad = np.array(
        [scene.pixel(frame.centre + 0.1 * frame.size * axis) - centre for axis in np.eye(3)]
    )
    places = (
        {name: scene.pixel(tip) for name, tip in tips.items()},
        [scene.pixel(x) for x in numbers],
    )
    plotter.close()
    return Rendering(np.asarray(image), centre, *places, triad)


def empty_stage(pixels: tuple[int, int]) -> tuple[Any, Any]:
    """pyvista and a plotter off screen that shows translucent surfaces in the right order."""
    pyvista = pyvista_off_screen()
    plotter = pyvista.Plotter(off_screen=True, window_size=list(pixels), lighting="three lights")
    plotter.background_color = "white"
    plotter.render_window.SetMultiSamples(0)  # depth peeling cannot do with them
    plotter.enable_depth_peeling(6)
    return pyvista, plotter


def bed_around(
    pyvista: Any, terrain: Terrain, centre: np.ndarray, reach: float, step: float
) -> Any:
    """The bed's surface about a vertical line through a point, cut off in a circle of radius `reach`."""
    side = np.arange(-reach, reach + step, step)
    x, y = np.meshgrid(centre[0] + side, centre[1] + side)
    z = terrain.height(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
    surface = pyvista.StructuredGrid(x, y, z).extract_surface(algorithm="dataset_surface")
    return within(surface, centre, reach)


def within(surface: Any, centre: np.ndarray, reach: float) -> Any:
    """What of a surface, or of lines, is not farther from a vertical line than `reach`."""
    surface["away"] = np.hypot(*(surface.points[:, :2] - centre[:2]).T)
    return surface.clip_scalar(scalars="away", value=reach)


def frame_of(case: Judged, points: np.ndarray) -> CameraFrame:
    """The weight down and the flow to the right, about a grain with a surface through points (n, 3)."""
    weight, flow = case.load.weight, case.load.flow_force
    up = unit(-weight if weight.any() else -case.contacts.normals.sum(axis=0))
    up = up if up.any() else np.array([0.0, 0.0, 1.0])
    level = flow - (flow @ up) * up
    if np.linalg.norm(level) <= 1e-9 * np.linalg.norm(flow):
        level = _across(up)
    return CameraFrame(unit(level), up, case.load.centre, float(np.ptp(points, axis=0).max()))


class Stage:
    """What is put before the camera; lengths are counted in grain sizes."""

    def __init__(self, pyvista: Any, plotter: Any, frame: CameraFrame):
        self.pyvista, self.plotter, self.frame = pyvista, plotter, frame

    def grain(self, points: np.ndarray, triangles: np.ndarray) -> None:
        """The grain's surface, translucent, with sharp edges marked."""
        surface = self._surface(points, triangles)
        self._show(surface, GRAIN, opacity=0.3, culling="back")
        edges = surface.extract_feature_edges(_SHARP, boundary_edges=False, manifold_edges=False)
        if edges.n_points:
            self.plotter.add_mesh(edges, color=INK, line_width=2.0, lighting=False)
        self.plotter.add_silhouette(surface, color=INK, line_width=3.0)

    def load(self, case: Judged) -> dict[str, np.ndarray]:
        """Forces and couple at the centre; returns the tips of the forces."""
        frame, largest = self.frame, case.largest
        tips = {}
        for name, force in case.acting.items():
            if np.linalg.norm(force) > SMALL * largest:
                tip = STRONGEST * frame.size / largest * force
                self._arrow(frame.centre, tip, FORCES[name], _THIN)
                tips[name] = frame.centre + tip
        dot = self.pyvista.Sphere(radius=0.022 * frame.size, center=frame.centre)
        self.plotter.add_mesh(dot, color=INK, lighting=False)
        if np.linalg.norm(case.load.flow_couple) > 1e-3 * frame.size * np.linalg.norm(
            case.load.flow_force
        ):
            self._arc(case.load.flow_couple, _COUPLE * frame.size, FLOW, 0.8 * _THIN)
        return tips

    def bed(self, terrain: Terrain) -> None:
        """The bed below and around the grain, translucent."""
        reach, step = (share * self.frame.size for share in _BED)
        self._show(
            bed_around(self.pyvista, terrain, self.frame.centre, reach, step), GROUND, opacity=0.4
        )

    def contacts(self, case: Judged, pieces: bool = True) -> list[np.ndarray]:
        """Pieces of bed, cones and the forces in them; where the contacts' numbers belong."""
        size, scale, numbers = self.frame.size, STRONGEST * self.frame.size / case.largest, []
        for group in case.patches if pieces else ():
            self._plate(case.contacts.points[group], case.contacts.normals[group[0]])
        places = zip(case.contacts.points, case.contacts.normals, strict=True)
        for index, (point, normal) in enumerate(places):
            colour, force = STATES[case.states[index]][0], scale * case.forces[index]
            if pieces and not any(index in group for group in case.patches):
                self._piece(point, normal)
            reach = max(SHORTEST_CONE * size, BEYOND * float(np.linalg.norm(force)))
            self._cone(point, normal, case.cone_angle, reach, colour)
            if np.linalg.norm(force) > 1e-6 * size:
                self._arrow(point, force, colour, 1.3 * _THIN)
            if index in case.significant:
                self._ring(point, normal)
            numbers.append(point + 0.13 * size * normal)
        return numbers

    def motion(self, motion: DrawnMotion, points: np.ndarray, triangles: np.ndarray) -> None:
        """The grain a little later; the acceleration of its centre; the sense in which it turns."""
        frame = self.frame
        speeds = motion.at(points - frame.centre)
        fastest = float(np.linalg.norm(speeds, axis=1).max()) or 1.0
        if len(triangles):
            later = self._surface(points + MOVED * frame.size / fastest * speeds, triangles)
            self._show(later, MOTION, opacity=0.08, culling="back")
            self.plotter.add_silhouette(later, color=MOTION, line_width=2.0)
        if np.linalg.norm(motion.acceleration) > 1e-6 * fastest:
            tip = _ACCELERATION * frame.size * unit(motion.acceleration)
            self._arrow(frame.centre, tip, MOTION, _THICK)
        if np.linalg.norm(motion.angular) * frame.size > 1e-6 * fastest:
            farthest = float(np.linalg.norm(points - frame.centre, axis=1).max())
            self._arc(motion.angular, farthest + 0.08 * frame.size, MOTION, 1.3 * _THIN)

    def look(self, shown: np.ndarray) -> None:
        """Turn the camera to see points (n, 3)."""
        frame, camera = self.frame, self.plotter.camera
        turned, raised = np.radians([_TURNED, _RAISED])
        beside = np.cos(turned) * np.cross(frame.along, frame.up) - np.sin(turned) * frame.along
        toward = np.cos(raised) * beside + np.sin(raised) * frame.up
        right = np.cross(frame.up, toward) / np.linalg.norm(np.cross(frame.up, toward))
        upward = np.cross(toward, right)
        across, above = shown @ right, shown @ upward
        middle = np.ptp(shown @ toward) / 2 + (shown @ toward).min()
        focus = right * _middle(across) + upward * _middle(above) + toward * middle
        camera.parallel_projection = True
        camera.focal_point, camera.up = focus, upward
        camera.position = focus + 10.0 * frame.size * toward
        half = 0.54 * max(np.ptp(above), np.ptp(across) * PIXELS[1] / PIXELS[0])
        camera.parallel_scale = half + 0.06 * frame.size
        self.plotter.reset_camera_clipping_range()

    def pixel(self, place: np.ndarray) -> np.ndarray:
        """Where a point is in the image, from the upper left, (2,)."""
        renderer = self.plotter.renderer
        renderer.SetWorldPoint(*place, 1.0)
        renderer.WorldToDisplay()
        across, up, _ = renderer.GetDisplayPoint()
        return np.array([across, PIXELS[1] - up])

    def _surface(self, points: np.ndarray, triangles: np.ndarray) -> Any:
        """Triangles that face outward."""
        heads = np.full((len(triangles), 1), 3)
        surface = self.pyvista.PolyData(points, np.hstack([heads, triangles]).ravel())
        return surface.compute_normals(auto_orient_normals=True, point_normals=False)

    def _show(
        self, mesh: Any, colour: str, opacity: float = 1.0, culling: str | None = None
    ) -> None:
        self.plotter.add_mesh(
            mesh, color=colour, opacity=opacity, culling=culling, ambient=0.3, smooth_shading=True,
            split_sharp_edges=True, feature_angle=_SHARP,
        )  # fmt: skip

    def _arrow(self, tail: np.ndarray, vector: np.ndarray, colour: str, radius: float) -> None:
        """A shaft and a head that keep their thickness, unless the arrow is shorter than its head."""
        length, along = float(np.linalg.norm(vector)), unit(vector)
        radius = min(radius * self.frame.size, length / 9.0)
        head = min(7.0 * radius, 0.8 * length)
        drawn = self.pyvista.Arrow(
            start=tail, direction=along, scale=length, tip_length=head / length, tip_radius=2.6 * radius / length,
            tip_resolution=48, shaft_radius=radius / length, shaft_resolution=32,
        )  # fmt: skip
        self._show(drawn, colour)

    def _arc(self, axis: np.ndarray, radius: float, colour: str, thickness: float) -> None:
        """An arc about an axis through the centre with a head; at the top, or where it is best seen."""
        frame, axis = self.frame, unit(axis)
        top = frame.up - (frame.up @ axis) * axis
        if np.linalg.norm(top) < 0.3:
            top = (
                -np.cross(frame.along, frame.up) - (-np.cross(frame.along, frame.up) @ axis) * axis
            )
        top = unit(top)
        angles = np.radians(np.linspace(-_ARC, _ARC, 60))[:, None]
        points = frame.centre + radius * (
            np.cos(angles) * top + np.sin(angles) * np.cross(axis, top)
        )
        tube = self.pyvista.Spline(points, 120).tube(radius=thickness * frame.size, n_sides=24)
        self._show(tube, colour)
        along, head = unit(points[-1] - points[-2]), 7.0 * thickness * frame.size
        sizes = {"height": head, "radius": 0.37 * head, "resolution": 48}
        tip = points[-1] + 0.6 * head * along
        self._show(
            self.pyvista.Cone(center=tip - 0.5 * head * along, direction=along, **sizes), colour
        )

    def _plate(self, corners: np.ndarray, normal: np.ndarray) -> None:
        """A piece of bed under a patch, reaching beyond its corners (n, 3)."""
        first, middle = _across(normal), corners.mean(axis=0)
        arms = corners - middle
        order = np.argsort(np.arctan2(arms @ np.cross(normal, first), arms @ first))
        around = middle + _PLATE * arms[order]
        if len(around) < 3:
            for corner in corners:
                self._piece(corner, normal)
            return
        face = self.pyvista.PolyData(around, [len(around), *range(len(around))])
        self._show(
            face.extrude(_PATCH[1] * self.frame.size * normal, capping=True), GROUND, opacity=0.75
        )

    def _piece(self, point: np.ndarray, normal: np.ndarray) -> None:
        radius, thickness = (share * self.frame.size for share in _PATCH)
        piece = self.pyvista.Cylinder(
            center=point + 0.5 * thickness * normal, direction=normal, radius=radius, height=thickness,
            resolution=96,
        )  # fmt: skip
        self._show(piece, GROUND, opacity=0.75)

    def _cone(
        self, point: np.ndarray, normal: np.ndarray, angle: float, reach: float, colour: str
    ) -> None:
        if angle == 0.0:
            return
        height = reach * np.cos(angle)
        cone = self.pyvista.Cone(
            center=point - 0.5 * height * normal, direction=normal, height=height,
            radius=reach * np.sin(angle), resolution=96, capping=False,
        )  # fmt: skip
        self._show(cone, colour, opacity=0.28)
        rim = cone.extract_feature_edges(feature_edges=False, manifold_edges=False)
        self.plotter.add_mesh(rim, color=colour, line_width=2.0, lighting=False)

    def _ring(self, point: np.ndarray, normal: np.ndarray) -> None:
        radius, thickness = (share * self.frame.size for share in _RING)
        first = _across(normal)
        angles = np.linspace(0.0, 2.0 * np.pi, 73)[:, None]
        circle = point + radius * (
            np.cos(angles) * first + np.sin(angles) * np.cross(normal, first)
        )
        tube = self.pyvista.Spline(circle, 144).tube(radius=thickness, n_sides=20)
        self._show(tube, REACTION)


def _across(direction: np.ndarray) -> np.ndarray:
    """A unit vector perpendicular to a direction."""
    return unit(np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))]))


def _middle(values: np.ndarray) -> float:
    return float(values.min() + values.max()) / 2
