"""The plane through a run in space that pictures show: fields at the points where they are, on curved cells."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from incipient.output.series_file import Step
from incipient.pictures.record import Run
from incipient.pictures.section import PARTS, section_of

EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))  # of a tetrahedron, in VTK's order of their nodes
CUBE = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
SIX = ((0, 4, 6, 7), (0, 4, 5, 7), (0, 2, 6, 7), (0, 2, 3, 7), (0, 1, 5, 7), (0, 1, 3, 7))


def quadratic(corners: np.ndarray, cells: tuple[tuple[int, ...], ...]) -> tuple[np.ndarray, np.ndarray]:
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


def test_the_parts_fill_the_cell() -> None:
    """Eight of the same volume; for a cell of straight edges."""
    points, cells = quadratic(np.vstack([np.zeros(3), np.eye(3)]), ((0, 1, 2, 3),))
    corners = points[cells[0][np.array(PARTS)]]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6.0
    assert np.allclose(volumes, 1.0 / 48.0)


def test_fields_stand_where_they_are_on_curved_cells() -> None:
    """A cube whose floor rises in a hump: x at every point is x, and below the hump there is nothing."""
    points, cells = quadratic(CUBE, SIX)
    points[:, 2] += 1.6 * points[:, 0] * (1.0 - points[:, 0]) * (1.0 - points[:, 2])  # 0.4 in the middle
    fields = {"pressure": points[:, 0].copy(), "velocity": points.copy()}
    run = Run(
        Path(),
        {},
        {"domain": {"origin": [0.0, 0.0, 0.0], "width": 1.0}},
        Step(0.0, points, cells, fields),
        None,
    )
    section = section_of(run, (0.0, 1.0, 0.0, 1.0), ["pressure", "velocity"], 50)
    across = np.broadcast_to(section.x, section.inside.shape)
    assert np.abs(section.fields["pressure"] - across)[section.inside].max() < 1e-6
    assert not section.inside[section.z < 0.3][:, np.abs(section.x - 0.5) < 0.1].any()
    assert section.inside[section.z > 0.6].all()
