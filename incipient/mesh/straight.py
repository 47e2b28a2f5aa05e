"""Straight cells among curved ones: those whose nodes lie where the vertices alone would put them."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import compat
from ..arrays import Floats

# By how much, relative to its extent, a cell's nodes may be off those of a straight one.
ROUND_OFF = 1e-10


def barycentric_nodes(mesh: Any) -> Floats:
    """(nodes per cell, dimension + 1) barycentric coordinates of a cell's nodes, vertices first. Not collective."""
    nodes = compat.reference_nodes(mesh)
    return np.column_stack([1.0 - nodes.sum(axis=1), nodes])


def straight_cells(mesh: Any) -> np.ndarray:
    """Local cells to which an affine map takes the reference cell, up to round-off, ascending. Not collective."""
    corners = barycentric_nodes(mesh)
    places = mesh.geometry.x[compat.geometry_dofs(mesh)]
    affine = np.einsum("nc,kcd->knd", corners, places[:, : corners.shape[1]])
    bend, extent = np.abs(places - affine).max(axis=(1, 2)), np.ptp(places, axis=1).max(axis=1)
    return np.flatnonzero(bend <= ROUND_OFF * extent).astype(np.int32)
