"""Evenly spaced streamlines, placed by VTK on a regular grid."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from .mesh import QuadraticMesh, triangles_of

_CELLS_ACROSS = 500
_RATIO = 0.45  # of the separation: a streamline ends where it comes this near to another, or to itself
_SLOWEST = 1e-4  # of the greatest speed: a streamline ends where the fluid is slower


@dataclass(frozen=True)
class Sampled:
    """Velocity (rows, columns, 2) on a regular grid, zero outside the fluid."""

    origin: np.ndarray
    spacing: float
    velocity: np.ndarray


def sample(mesh: QuadraticMesh, velocity: np.ndarray, view: tuple[float, float, float, float]) -> Sampled:
    """Nodal velocity (nodes, 2) on a grid over a rectangle (left, right, bottom, top)."""
    from matplotlib.tri import LinearTriInterpolator

    x0, x1, y0, y1 = view
    spacing = max(x1 - x0, y1 - y0) / _CELLS_ACROSS
    x, y = np.arange(x0, x1 + spacing / 2, spacing), np.arange(y0, y1 + spacing / 2, spacing)
    seen = mesh.within(view)
    triangulation = triangles_of(seen.points, seen.quarters)
    finder = triangulation.get_trifinder()
    grids = np.meshgrid(x, y)
    components = [
        np.ma.filled(LinearTriInterpolator(triangulation, values, finder)(*grids), 0.0)
        for values in velocity.T
    ]
    return Sampled(np.array([x0, y0]), spacing, np.stack(components, axis=-1))


def streamlines(sampled: Sampled, separation: float) -> list[np.ndarray]:
    """Lines (n, 2) about `separation` apart, directed with the flow; none where the fluid is at rest."""
    speed = np.linalg.norm(sampled.velocity, axis=-1)
    if not speed.max() > 0:
        return []
    tracer = _tracer(sampled, separation, speed)
    tracer.Update()
    lines = (_until_return(line, _RATIO * separation) for line in _polylines(tracer.GetOutput()))
    long = [line for line in lines if _length(line) > 1.5 * separation]
    return [line if _along(line, sampled) else line[::-1] for line in long]


def _tracer(sampled: Sampled, separation: float, speed: np.ndarray) -> Any:
    from vtkmodules.vtkFiltersFlowPaths import vtkEvenlySpacedStreamlines2D

    rows, columns = speed.shape
    inner = speed[rows // 8 : -(rows // 8) or None, columns // 8 : -(columns // 8) or None]
    row, column = np.unravel_index(np.argmax(inner), inner.shape)
    start = sampled.origin + sampled.spacing * np.array([column + columns // 8, row + rows // 8])
    tracer = vtkEvenlySpacedStreamlines2D()
    tracer.SetInputData(_image(sampled))
    tracer.SetStartPosition(float(start[0]), float(start[1]), 0.0)
    tracer.SetIntegratorTypeToRungeKutta4()
    tracer.SetIntegrationStepUnit(1)  # steps are lengths
    tracer.SetInitialIntegrationStep(sampled.spacing)
    tracer.SetSeparatingDistance(separation)
    tracer.SetSeparatingDistanceRatio(_RATIO)
    tracer.SetClosedLoopMaximumDistance(sampled.spacing)
    tracer.SetMaximumNumberOfSteps(8 * _CELLS_ACROSS)
    tracer.SetTerminalSpeed(_SLOWEST * speed.max())
    return tracer


def _image(sampled: Sampled) -> Any:
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData

    rows, columns = sampled.velocity.shape[:2]
    image = vtkImageData()
    image.SetDimensions(columns, rows, 1)
    image.SetOrigin(float(sampled.origin[0]), float(sampled.origin[1]), 0.0)
    image.SetSpacing(sampled.spacing, sampled.spacing, 1.0)
    in_space = np.zeros((rows * columns, 3))
    in_space[:, :2] = sampled.velocity.reshape(-1, 2)
    vectors = numpy_to_vtk(in_space, deep=True)
    vectors.SetName("velocity")
    image.GetPointData().SetVectors(vectors)
    return image


def _polylines(output: Any) -> list[np.ndarray]:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    if not output.GetNumberOfLines():
        return []
    points = vtk_to_numpy(output.GetPoints().GetData())[:, :2]
    offsets = vtk_to_numpy(output.GetLines().GetOffsetsArray())
    nodes = vtk_to_numpy(output.GetLines().GetConnectivityArray())
    return [points[nodes[i:j]] for i, j in pairwise(offsets)]


def _until_return(line: np.ndarray, near: float) -> np.ndarray:
    """Every third point of a line, up to where it comes back `near` to itself: once round an eddy."""
    thin = np.vstack([line[:-1:3], line[-1:]])
    reached = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(thin, axis=0), axis=1))])
    apart = np.linalg.norm(thin[:, None] - thin, axis=2)
    returned = np.any((apart < near) & (reached[:, None] - reached > 6 * near), axis=1)
    return thin[: int(np.argmax(returned)) + 1] if returned.any() else thin


def _length(line: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def _along(line: np.ndarray, sampled: Sampled) -> bool:
    """Whether a line runs with the flow, judged in its middle."""
    middle = len(line) // 2
    column, row = np.round((line[middle] - sampled.origin) / sampled.spacing).astype(int)
    rows, columns = sampled.velocity.shape[:2]
    velocity = sampled.velocity[min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)]
    return bool(velocity @ (line[middle] - line[middle - 1]) >= 0)
