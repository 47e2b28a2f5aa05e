"""The channel with a cylinder of the DFG benchmarks, meshed by Netgen with curved cells."""

import ngsolve as ng
from netgen.geom2d import SplineGeometry

LENGTH, HEIGHT, DIAMETER, VISCOSITY = 2.2, 0.41, 0.1, 1e-3


def make_mesh(near: float, far: float, order: int) -> ng.Mesh:
    geometry = SplineGeometry()
    geometry.AddRectangle((0, 0), (LENGTH, HEIGHT), bcs=("wall", "outflow", "wall", "inflow"))
    geometry.AddCircle(
        (0.2, 0.2), r=DIAMETER / 2, leftdomain=0, rightdomain=1, bc="cylinder", maxh=near
    )
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=far))
    mesh.Curve(order)
    return mesh
