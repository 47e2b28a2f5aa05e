"""A judged grain in 3-D through VTK: what `plane` draws, translucent, seen from the side, the weight down.

Shapes alone are rendered, the flow to the right; matplotlib sets the words at the places that the rendering gives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..arrays import unit
from ..geometry.space.beds import Terrain
from .judged import BEYOND, MOVED, SHORTEST_CONE, SMALL, STRONGEST, DrawnMotion, Judged
from .plane import Marks, aside, label, marks_of
from .section import pyvista_off_screen
from .style import FLOW, FORCES, GRAIN, GROUND, INK, MOTION, PAPER, REACTION, STATES, Looks

PIXELS = (1590, 1320)
_TURNED, _RAISED = 24.0, 17.0  # of the view: from across the flow, above the horizontal [degrees]
# Lengths in grain sizes.
_THIN, _THICK = 0.012, 0.022  # radii of arrows
_PATCH = (0.2, 0.035)  # radius and thickness of a piece of bed
_PLATE = 1.25  # by how much a piece of bed under a patch is larger than it
_RING = (0.055, 0.008)
_ACCELERATION, _TORQUE = 0.5, 0.25
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


def rendered(
    case: Judged, points: np.ndarray, triangles: np.ndarray, terrain: Terrain | None = None
) -> Rendering:
    """Render a case with the grain's surface, points (n, 3) and triangles (m, 3), off screen. Not collective.

    Without the bed's shape pieces of it are drawn at the contacts.
    """
    scene = _Stage(case, points)
    if len(triangles):
        scene.grain(points, triangles)
    if terrain is not None:
        scene.bed(terrain)
    tips, numbers = scene.load(case), scene.contacts(case, pieces=terrain is None)
    if case.motion is not None:
        scene.motion(case.motion, points, triangles)
    scene.look(np.vstack([points, *tips.values(), *numbers]))
    image = np.asarray(scene.plotter.screenshot(return_img=True))
    centre = scene.pixel(scene.centre)
    axes = 0.1 * scene.size * np.eye(3)
    found = Rendering(
        image=image,
        centre=centre,
        tips={name: scene.pixel(tip) for name, tip in tips.items()},
        numbers=[scene.pixel(place) for place in numbers],
        triad=np.array([scene.pixel(scene.centre + axis) - centre for axis in axes]),
    )
    scene.plotter.close()
    return found


class _Stage:
    """What is put before the camera, about the grain's centre; lengths are counted in grain sizes."""

    def __init__(self, case: Judged, points: np.ndarray):
        self.pyvista = pyvista_off_screen()
        self.plotter = self.pyvista.Plotter(
            off_screen=True, window_size=list(PIXELS), lighting="three lights"
        )
        self.plotter.background_color = "white"
        self.plotter.render_window.SetMultiSamples(0)  # depth peeling cannot do with them
        self.plotter.enable_depth_peeling(6)  # translucent surfaces in the right order
        weight, flow = case.load.weight, case.load.flow_force
        up = unit(-weight if weight.any() else -case.contacts.normals.sum(axis=0))
        self.up = up if up.any() else np.array([0.0, 0.0, 1.0])
        level = flow - (flow @ self.up) * self.up
        sideways = np.linalg.norm(level) <= 1e-9 * np.linalg.norm(flow)
        self.along = unit(_across(self.up) if sideways else level)
        self.centre, self.size = case.load.centre, float(np.ptp(points, axis=0).max())

    def grain(self, points: np.ndarray, triangles: np.ndarray) -> None:
        """Show the grain's surface, translucent, with sharp edges marked."""
        surface = self._surface(points, triangles)
        self._show(surface, GRAIN, opacity=0.3, culling="back")
        edges = surface.extract_feature_edges(_SHARP, boundary_edges=False, manifold_edges=False)
        if edges.n_points:
            self.plotter.add_mesh(edges, color=INK, line_width=2.0, lighting=False)
        self.plotter.add_silhouette(surface, color=INK, line_width=3.0)

    def bed(self, terrain: Terrain) -> None:
        """Show the bed below and around the grain, translucent, cut off in a circle."""
        reach, step = (part * self.size for part in _BED)
        side = np.arange(-reach, reach + step, step)
        x, y = np.meshgrid(self.centre[0] + side, self.centre[1] + side)
        z = terrain.height(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
        surface = self.pyvista.StructuredGrid(x, y, z).extract_surface(algorithm="dataset_surface")
        surface["away"] = np.hypot(*(surface.points[:, :2] - self.centre[:2]).T)
        self._show(surface.clip_scalar(scalars="away", value=reach), GROUND, opacity=0.4)

    def load(self, case: Judged) -> dict[str, np.ndarray]:
        """Show forces and torque at the centre; returns the tips of the forces."""
        tips = {}
        for name, force in case.acting.items():
            if np.linalg.norm(force) > SMALL * case.largest:
                tip = STRONGEST * self.size / case.largest * force
                self._arrow(self.centre, tip, FORCES[name], _THIN)
                tips[name] = self.centre + tip
        dot = self.pyvista.Sphere(radius=0.022 * self.size, center=self.centre)
        self.plotter.add_mesh(dot, color=INK, lighting=False)
        torque, force = case.load.flow_couple, case.load.flow_force
        if np.linalg.norm(torque) > 1e-3 * self.size * np.linalg.norm(force):
            self._arc(torque, _TORQUE * self.size, FLOW, 0.8 * _THIN)
        return tips

    def contacts(self, case: Judged, pieces: bool = True) -> list[np.ndarray]:
        """Show pieces of bed, cones and the forces in them; returns where the contacts' numbers belong."""
        scale, numbers = STRONGEST * self.size / case.largest, []
        points, normals = case.contacts.points, case.contacts.normals
        for group in case.patches if pieces else ():
            self._plate(points[group], normals[group[0]])
        for index, (point, normal) in enumerate(zip(points, normals, strict=True)):
            colour, force = STATES[case.states[index]][0], scale * case.forces[index]
            if pieces and not any(index in group for group in case.patches):
                self._piece(point, normal)
            reach = max(SHORTEST_CONE * self.size, BEYOND * float(np.linalg.norm(force)))
            self._cone(point, normal, case.cone_angle, reach, colour)
            if np.linalg.norm(force) > 1e-6 * self.size:
                self._arrow(point, force, colour, 1.3 * _THIN)
            if index in case.significant:
                radius, thickness = (part * self.size for part in _RING)
                ring = self.pyvista.ParametricTorus(radius, thickness)
                turned = ring.rotate_vector(*_turn((0.0, 0.0, 1.0), normal)).translate(point)
                self._show(turned, REACTION)
            numbers.append(point + 0.13 * self.size * normal)
        return numbers

    def motion(self, motion: DrawnMotion, points: np.ndarray, triangles: np.ndarray) -> None:
        """Show the grain a little later, the acceleration of its centre, the sense in which it turns."""
        speeds = motion.at(points - self.centre)
        fastest = float(np.linalg.norm(speeds, axis=1).max()) or 1.0
        if len(triangles):
            later = self._surface(points + MOVED * self.size / fastest * speeds, triangles)
            self._show(later, MOTION, opacity=0.08, culling="back")
            self.plotter.add_silhouette(later, color=MOTION, line_width=2.0)
        if np.linalg.norm(motion.acceleration) > 1e-6 * fastest:
            tip = _ACCELERATION * self.size * unit(motion.acceleration)
            self._arrow(self.centre, tip, MOTION, _THICK)
        if np.linalg.norm(motion.angular) * self.size > 1e-6 * fastest:
            farthest = float(np.linalg.norm(points - self.centre, axis=1).max())
            self._arc(motion.angular, farthest + 0.08 * self.size, MOTION, 1.3 * _THIN)

    def look(self, shown: np.ndarray) -> None:
        """Turn the camera to see points (n, 3)."""
        turned, raised = np.radians([_TURNED, _RAISED])
        beside = np.cos(turned) * np.cross(self.along, self.up) - np.sin(turned) * self.along
        toward = np.cos(raised) * beside + np.sin(raised) * self.up
        right = unit(np.cross(self.up, toward))
        upward = np.cross(toward, right)
        seen = shown @ np.array([right, upward, toward]).T
        middle, extent = (seen.min(axis=0) + seen.max(axis=0)) / 2, np.ptp(seen, axis=0)
        focus = middle @ np.array([right, upward, toward])
        camera = self.plotter.camera
        camera.parallel_projection = True
        camera.focal_point, camera.up = focus, upward
        camera.position = focus + 10.0 * self.size * toward
        half = 0.54 * max(extent[1], extent[0] * PIXELS[1] / PIXELS[0])
        camera.parallel_scale = half + 0.06 * self.size
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
        surface = self.pyvista.PolyData.from_regular_faces(points, triangles)
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
        length = float(np.linalg.norm(vector))
        radius = min(radius * self.size, length / 9.0) / length
        head = min(7.0 * radius, 0.8)
        drawn = self.pyvista.Arrow(
            start=tail, direction=unit(vector), scale=length, tip_length=head, tip_radius=2.6 * radius,
            tip_resolution=48, shaft_radius=radius, shaft_resolution=32,
        )  # fmt: skip
        self._show(drawn, colour)

    def _arc(self, axis: np.ndarray, radius: float, colour: str, thickness: float) -> None:
        """An arc about an axis through the centre with a head; at the top, or where it is best seen."""
        axis, toward = unit(axis), -np.cross(self.along, self.up)
        top = self.up - (self.up @ axis) * axis
        top = unit(top if np.linalg.norm(top) >= 0.3 else toward - (toward @ axis) * axis)
        angles = np.radians(np.linspace(-_ARC, _ARC, 60))[:, None]
        points = self.centre + radius * (
            np.cos(angles) * top + np.sin(angles) * np.cross(axis, top)
        )
        tube = self.pyvista.Spline(points, 120).tube(radius=thickness * self.size, n_sides=24)
        self._show(tube, colour)
        along, head = unit(points[-1] - points[-2]), 7.0 * thickness * self.size
        shape = {"height": head, "radius": 0.37 * head, "resolution": 48}
        place = points[-1] + 0.1 * head * along
        self._show(self.pyvista.Cone(center=place, direction=along, **shape), colour)

    def _plate(self, corners: np.ndarray, normal: np.ndarray) -> None:
        """A piece of bed under a patch, reaching beyond its corners (n, 3)."""
        if len(corners) < 3:
            for corner in corners:
                self._piece(corner, normal)
            return
        first, middle = _across(normal), corners.mean(axis=0)
        arms = corners - middle
        order = np.argsort(np.arctan2(arms @ np.cross(normal, first), arms @ first))
        around = middle + _PLATE * arms[order]
        face = self.pyvista.PolyData(around, [len(around), *range(len(around))])
        plate = face.extrude(_PATCH[1] * self.size * normal, capping=True)
        self._show(plate, GROUND, opacity=0.75)

    def _piece(self, point: np.ndarray, normal: np.ndarray) -> None:
        radius, thickness = (part * self.size for part in _PATCH)
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


def _across(direction: np.ndarray) -> np.ndarray:
    """A unit vector perpendicular to a direction."""
    return unit(np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))]))


def _turn(old: tuple[float, float, float], new: np.ndarray) -> tuple[np.ndarray, float]:
    """Axis and angle [degrees] of the turn that takes one direction to another."""
    axis = np.cross(old, new)
    angle = float(np.degrees(np.arctan2(np.linalg.norm(axis), np.dot(old, new))))
    return (axis if axis.any() else np.array([1.0, 0.0, 0.0])), angle


def show_judged(
    axes: Axes,
    case: Judged,
    points: np.ndarray,
    triangles: np.ndarray,
    terrain: Terrain | None = None,
) -> Marks:
    """Show a judged case in 3-D with its grain's surface, points (n, 3) and triangles (m, 3); what the marks mean."""
    seen = rendered(case, points, triangles, terrain)
    rows, columns, _ = seen.image.shape
    axes.imshow(seen.image, aspect="auto", interpolation="antialiased")
    axes.set(xticks=[], yticks=[])
    upright = np.array([1.0, -1.0])  # images count rows downward
    along = {name: unit(upright * (tip - seen.centre)) for name, tip in seen.tips.items()}
    for name, arrow in along.items():
        others = [other for key, other in along.items() if key != name]
        place = seen.tips[name] + 0.015 * columns * upright * arrow
        label(axes, place, arrow + aside(arrow, others), name, FORCES[name])
    looks: Looks = {"ha": "center", "va": "center", "fontsize": 8}
    for index, (across, down) in enumerate(seen.numbers if len(seen.numbers) > 1 else ()):
        axes.text(across, down, f"{index + 1}", bbox=PAPER, **looks)
    corner = np.array([0.07 * columns, 0.92 * rows])
    longest = float(np.linalg.norm(seen.triad, axis=1).max())
    for name, direction in zip("xyz", 0.055 * columns / longest * seen.triad, strict=True):
        axes.plot(*np.array([corner, corner + direction]).T, color=INK, lw=1.0)
        across, down = corner + 1.3 * direction
        axes.text(across, down, name, **looks)
    return marks_of(case)
