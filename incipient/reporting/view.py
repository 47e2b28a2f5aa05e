"""Grain, bed and forces in space as triangles and arrows that a reader turns by hand (`templates/turn.js`).

Lengths are counted in grain sizes from the grain's centre.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex

from ..arrays import Floats
from ..errors import OutputError
from ..geometry.placement import Placement
from ..geometry.space.beds import Terrain
from ..pictures.flow.mesh import QUARTERS
from ..pictures.record import read
from ..pictures.style import FLOW, FORCES, GRAIN, GROUND, STATES
from ..pictures.verdict.judged import SMALL, STRONGEST, Judged
from ..pictures.verdict.space import last_colour, placed_surface, whole_surface
from ..scene import Scene
from .page import PageSection, Turned, section

REACH = 1.45  # of the bed that is shown, and SEEN half the height of the picture, in grain sizes
SEEN, SIDE = 1.15, 48  # SIDE: squares along the bed that is shown
TURNED, RAISED = -1.15, 0.42  # of the view at first, radians: azimuth, above the horizontal
COARSER = 3  # than in pictures are the triangles of a grain's surface
FEW = 1500  # quadratic triangles: fewer are cut into four
SHADES = 24  # of the traction's size
Sections = tuple[PageSection, ...]
HOW = "Drag to turn it, or use the arrow keys; + and - change its size."


class Model:
    """Points, triangles with their colours, and arrows, about a centre and in a unit of length."""

    def __init__(self, centre: Floats, size: float):
        self._centre, self._size = centre, size
        self._points: list[Floats] = []
        self._faces: list[list[int]] = []
        self._colours: list[str] = []
        self._arrows: list[dict[str, Any]] = []

    def add(
        self, points: Floats, triangles: np.ndarray, colours: list[str], which: np.ndarray
    ) -> None:
        """Add triangles (m, 3) of points (n, 3); `which` (m,) of the colours each has."""
        first, known = sum(map(len, self._points)), len(self._colours)
        self._points.append((points - self._centre) / self._size)
        self._colours += colours
        faces = np.column_stack([triangles + first, which + known])
        self._faces += faces.tolist()

    def arrow(self, tail: Floats, vector: Floats, colour: str, name: str) -> None:
        """Add an arrow from a point of the scene; the vector is in grain sizes."""
        start = (tail - self._centre) / self._size
        ends = {"tail": _short(start), "tip": _short(start + vector)}
        self._arrows.append({**ends, "colour": colour, "name": name})

    def data(self) -> dict[str, Any]:
        """What the script reads."""
        points = np.vstack(self._points) if self._points else np.empty((0, 3))
        return {
            "points": np.round(points, 3).tolist(),
            "faces": self._faces,
            "colours": self._colours,
            "arrows": self._arrows,
            "reach": SEEN,
            "turned": TURNED,
            "raised": RAISED,
        }


def of_run(directory: Path, stored: dict[str, Any], case: Judged | None) -> Sections:
    """The view of a run in space with a grain; none of other runs."""
    if stored["grain"] is None or stored["scene"]["domain"].get("width") is None:
        return ()
    scene = Scene(**stored["scene"])
    try:
        run = read(directory)
    except OutputError:  # no fields were wanted
        run = None
    if run is None or run.surface is None:
        return of_grain(scene.grain, scene.placement, scene.bed_shape, case)
    points, cells, tractions = whole_surface(run)
    centre, size = run.space("grain", "computed_centre"), float(stored["grain"]["size"])
    model = Model(centre, size)
    _add_bed(model, scene.bed_shape, centre, size)
    most = _add_traction(model, points, cells, tractions)
    shown = f"The grain's colour is the size of the traction, dark: none, bright: {most:.3g} scene units or more. "
    return _section(model, case, shown)


def of_grain(grain: Any, placement: Placement | None, bed: Any, case: Judged | None) -> Sections:
    """The view of a grain placed in space, by its bed, with the forces of its verdict; none in the plane or without."""
    if placement is None or placement.gdim == 2:
        return ()
    centre = np.array(placement.centre)
    model = Model(centre, grain.size)
    _add_bed(model, bed, centre, grain.size)
    _add_plain(model, *placed_surface(grain, placement, COARSER))
    return _section(model, case, "")


def of_case(case: Judged, points: Floats, triangles: np.ndarray) -> Sections:
    """The view of a judged case in space, with a grain's surface, points (n, 3) and triangles (m, 3)."""
    model = Model(case.load.centre, float(np.ptp(points, axis=0).max()))
    _add_plain(model, points, triangles)
    return _section(model, case, "")


def _section(model: Model, case: Judged | None, caption: str) -> Sections:
    if case is not None:
        _add_forces(model, case)
        caption += f"Arrows: the load at the centre, and at the contacts: {case.occasion}. "
    return section(
        "In space, to be turned", Turned("grain-in-space", model.data(), f"{caption}{HOW}")
    )


def _add_plain(model: Model, points: Floats, triangles: np.ndarray) -> None:
    model.add(points, triangles, [GRAIN], np.zeros(len(triangles), dtype=int))


def _add_traction(model: Model, points: Floats, cells: np.ndarray, tractions: Floats) -> float:
    """Add the grain's surface, quadratic cells (m, 6), in the colours of the traction; the size of the last colour."""
    triangles = cells[:, QUARTERS if len(cells) < FEW else [(0, 1, 2)]].reshape(-1, 3)
    sizes = np.linalg.norm(tractions, axis=1)
    most = last_colour(sizes)
    shades = np.minimum(sizes[triangles].mean(axis=1) / most * SHADES, SHADES - 1).astype(int)
    palette = [
        to_hex(colormaps["magma"](0.12 + 0.85 * number / (SHADES - 1))) for number in range(SHADES)
    ]
    used, numbers = np.unique(triangles, return_inverse=True)
    model.add(points[used], numbers.reshape(triangles.shape), palette, shades)
    return most


def _add_bed(model: Model, bed: Terrain | None, centre: Floats, size: float) -> None:
    """Add the bed around the grain, cut off in a circle."""
    if bed is None:
        return
    steps = REACH * size * np.linspace(-1.0, 1.0, SIDE + 1)
    x, y = (one.ravel() for one in np.meshgrid(centre[0] + steps, centre[1] + steps))
    number = np.arange((SIDE + 1) ** 2).reshape(SIDE + 1, SIDE + 1)
    corners = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    a, b, c, d = (part.ravel() for part in corners)
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    near = np.hypot(x - centre[0], y - centre[1])[triangles].max(axis=1) <= REACH * size
    used, numbers = np.unique(triangles[near], return_inverse=True)
    points = np.column_stack([x, y, bed.height(np.column_stack([x, y]))])[used]
    model.add(points, numbers.reshape(-1, 3), [GROUND], np.zeros(int(near.sum()), dtype=int))


def _add_forces(model: Model, case: Judged) -> None:
    """Add the load at the grain's centre and the forces at its contacts."""
    largest = case.largest
    for name, force in case.acting.items():
        if np.linalg.norm(force) > SMALL * largest:
            model.arrow(case.load.centre, STRONGEST / largest * force, FORCES.get(name, FLOW), name)
    at_contacts = zip(case.contacts.points, case.forces, case.states, strict=True)
    for number, (point, force, state) in enumerate(at_contacts, start=1):
        if np.linalg.norm(force) > SMALL * largest:
            model.arrow(point, STRONGEST / largest * force, STATES[state][0], str(number))


def _short(point: Floats) -> list[float]:
    return [round(float(one), 3) for one in point]
