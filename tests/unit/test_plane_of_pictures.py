"""The plane through a run in space that pictures show: fields at the points where they are, on curved cells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from incipient.output.series_file import StoredStep
from incipient.pictures.drawing import Sight
from incipient.pictures.plane import grain_lines
from incipient.pictures.record import StoredRun
from incipient.pictures.verdict import of_run
from incipient.scene import Domain, Ellipsoid, Fluid, Scene, Shear

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
    points, known, found = [*corners], {}, []
    for cell in cells:
        row = list(cell)
        for ends in EDGES:
            edge = tuple(sorted(cell[end] for end in ends))
            if edge not in known:
                known[edge] = len(points)
                points.append(0.5 * (corners[edge[0]] + corners[edge[1]]))
            row.append(known[edge])
        found.append(row)
    return np.array(points), np.array(found)


def test_fields_stand_where_they_are_on_curved_cells() -> None:
    """A cube whose floor rises in a hump: x at every point is x, and below the hump there is nothing."""
    points, cells = quadratic(CUBE, SIX)
    points[:, 2] += (
        1.6 * points[:, 0] * (1.0 - points[:, 0]) * (1.0 - points[:, 2])
    )  # 0.4 in the middle
    fields = {"pressure": points[:, 0].copy(), "velocity": points.copy()}
    run = StoredRun(
        Path(),
        {},
        {"domain": {"origin": [0.0, 0.0, 0.0], "width": 1.0}},
        StoredStep(0.0, points, cells, fields),
        None,
    )
    x, z = np.meshgrid(np.linspace(0.01, 0.99, 50), np.linspace(0.01, 0.99, 50))
    found = run.plane.at(np.column_stack([x.ravel(), z.ravel()]), "pressure").reshape(x.shape)
    assert np.abs(found - x).max() < 1e-6
    assert found.mask[(z < 0.3) & (np.abs(x - 0.5) < 0.1)].all() and not found.mask[z > 0.6].any()


def test_the_line_around_the_fluid_is_that_of_its_curved_cells() -> None:
    """The hump's line is z = 1.6 x (1 - x), which curved cells of order two have; and the cube's straight sides."""
    points, cells = quadratic(CUBE, SIX)
    points[:, 2] += 1.6 * points[:, 0] * (1.0 - points[:, 0]) * (1.0 - points[:, 2])
    scene = {"domain": {"origin": [0.0, 0.0002, 0.0], "width": 1.0}}
    run = StoredRun(Path(), {}, scene, StoredStep(0.0, points, cells, {}), None)
    (line,) = run.plane.outlines
    x, z = line.T
    assert line[0] == pytest.approx(line[-1])
    assert (x.min(), x.max(), z.max()) == pytest.approx((0.0, 1.0, 1.0), abs=1e-6)
    floor = line[(x > 1e-6) & (x < 1 - 1e-6) & (z < 0.99)]
    assert len(floor) >= 4
    assert np.abs(floor[:, 1] - 1.6 * floor[:, 0] * (1.0 - floor[:, 0])).max() < 0.01


def test_the_line_around_a_grain_is_its_own() -> None:
    """An ellipsoid turned about y: every point of the line is on it, to 1e-3 of its size."""
    body = Ellipsoid(semi_axes=(0.6, 0.4, 0.3), centre=(2.0, 1.0, 1.0))
    domain = Domain(length=4.0, width=2.0, height=2.0)
    scene = Scene(domain=domain, flow=Shear(), fluid=Fluid(reynolds=1.0, scale="grain"), body=body)
    grain = {
        "computed_centre": [2.0, 1.0, 1.0],
        "quaternion": [np.cos(0.3), 0.0, np.sin(0.3), 0.0],
        "size": 1.2,
    }
    run = StoredRun(
        Path(),
        {"grain": grain},
        scene.model_dump(mode="json"),
        StoredStep(0.0, CUBE, np.zeros((0, 10), int), {}),
        None,
    )
    (line,) = grain_lines(run, grain["computed_centre"], 1.0)
    turn = np.array([[np.cos(0.6), np.sin(0.6)], [-np.sin(0.6), np.cos(0.6)]])
    x, z = turn.T @ (line - [2.0, 1.0]).T
    assert len(line) > 200
    assert np.abs(np.hypot(x / 0.6, z / 0.3) - 1.0).max() < 5e-3


def test_the_load_on_a_grain_in_space_is_drawn_without_a_verdict() -> None:
    """The force points along x, which the sight has to the right; its arrow begins at the centre."""
    body = Ellipsoid(semi_axes=(0.6, 0.4, 0.3), centre=(2.0, 1.0, 1.0))
    domain = Domain(length=4.0, width=2.0, height=2.0)
    scene = Scene(domain=domain, flow=Shear(), fluid=Fluid(reynolds=1.0, scale="grain"), body=body)
    result = {
        "grain": {"centre": [2.0, 1.0, 1.0], "quaternion": [1.0, 0.0, 0.0, 0.0]},
        "force": {"flow": [3.0, 0.0, 0.0]},
        "couple": {"flow": [0.0, 1.0, 0.0]},
    }
    cells = np.zeros((0, 10), int)
    stored = StoredStep(0.0, CUBE, cells, {})
    run = StoredRun(Path(), result, scene.model_dump(mode="json"), stored, None)
    (axes,) = of_run(run).axes
    assert len(axes.images) == 1
    sight = Sight.of(np.array([3.0, 0.0, 0.0]), np.zeros(3), np.empty((0, 3)))
    (force, *_) = [one for one in axes.patches if getattr(one, "_posA_posB", None) is not None]
    tail, tip = np.array(force._posA_posB)
    assert tail == pytest.approx(sight(np.array([2.0, 1.0, 1.0])))
    assert tip[0] - tail[0] == pytest.approx(0.8 * 1.2 * np.cos(np.radians(24.0)))
