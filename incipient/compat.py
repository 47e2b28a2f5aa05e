"""Every difference between the supported versions of dolfinx (0.5.2 to 0.11), one function each.

Nothing else in the package asks which version it runs on. Decisions are taken by what the library
offers, not by its version number.
"""

from __future__ import annotations

import inspect
from typing import Any

import dolfinx
import dolfinx.fem.petsc
import numpy as np
import ufl
from mpi4py import MPI
from petsc4py import PETSc

ADD = dolfinx.la.InsertMode.add if hasattr(dolfinx.la, "InsertMode") else dolfinx.la.ScatterMode.add


def element(mesh: Any, degree: int, shape: tuple[int, ...] = (), family: str = "Lagrange") -> Any:
    """Lagrange (or other) element of a degree on the mesh's cells, with values of a shape; () is a scalar."""
    cell = mesh.topology.cell_name() if hasattr(mesh.topology, "cell_name") else mesh.ufl_cell().cellname()
    if hasattr(ufl, "FiniteElement"):
        if not shape:
            return ufl.FiniteElement(family, cell, degree)
        return ufl.VectorElement(family, cell, degree, dim=shape[0])
    import basix.ufl

    return basix.ufl.element(family, cell, degree, shape=shape)


def mixed_element(parts: list[Any]) -> Any:
    """Mixed element of the given ones."""
    if hasattr(ufl, "MixedElement"):
        return ufl.MixedElement(parts)
    import basix.ufl

    return basix.ufl.mixed_element(parts)


def function_space(mesh: Any, any_element: Any) -> Any:
    """Function space of an element as made by `element` or `mixed_element`, or of a coordinate element."""
    make = getattr(dolfinx.fem, "functionspace", None) or dolfinx.fem.FunctionSpace
    return make(mesh, any_element)


def space(mesh: Any, degree: tuple[str, int], shape: tuple[int, ...] = ()) -> Any:
    """Function space such as `space(mesh, ("Lagrange", 2), (2,))`. Collective."""
    family, order = degree
    return function_space(mesh, element(mesh, order, shape, family))


def form(expression: Any, compiler: dict[str, Any] | None = None) -> Any:
    """Compile a UFL form. Collective; cached on disk by dolfinx."""
    keyword = "form_compiler_options"
    if keyword not in inspect.signature(dolfinx.fem.form).parameters:
        keyword = "form_compiler_params"
    return dolfinx.fem.form(expression, **{keyword: dict(compiler or {})})


def model_to_mesh(model: Any, comm: MPI.Comm, gdim: int) -> tuple[Any, Any, Any]:
    """Mesh, cell tags and facet tags of the gmsh model on rank 0, cells ghosted across shared facets. Collective."""
    if hasattr(dolfinx.io, "gmsh"):
        from dolfinx.io.gmsh import model_to_mesh as convert
    else:
        from dolfinx.io.gmshio import model_to_mesh as convert
    options = {"partitioner": partitioner()} if "partitioner" in inspect.signature(convert).parameters else {}
    converted = convert(model, comm, 0, gdim=gdim, **options)
    return converted[0], converted[1], converted[2]


def partitioner() -> Any:
    """Cell partitioner whose ghosts share a facet (the default of 0.5.2, not of later versions)."""
    mode = dolfinx.mesh.GhostMode.shared_facet
    for arguments in ((mode,), (mode, 2)):
        try:
            return dolfinx.mesh.create_cell_partitioner(*arguments)
        except TypeError:
            continue
    return dolfinx.mesh.create_cell_partitioner()


def exterior_facets(mesh: Any) -> np.ndarray:
    """Local indices of the owned facets on the domain's boundary. Collective."""
    dimension = mesh.topology.dim
    mesh.topology.create_connectivity(dimension - 1, dimension)
    return dolfinx.mesh.exterior_facet_indices(mesh.topology)


def cell_dofs(function_space: Any) -> np.ndarray:
    """(cells, nodes per cell) block degrees of freedom of all local cells, ghosts included."""
    return _table(function_space.dofmap.list, function_space.mesh)


def geometry_dofs(mesh: Any) -> np.ndarray:
    """(cells, nodes per cell) rows of `mesh.geometry.x` of all local cells, ghosts included."""
    dofmaps = getattr(mesh.geometry, "dofmaps", None)
    return _table(dofmaps[0] if dofmaps is not None else mesh.geometry.dofmap, mesh)


def _table(links: Any, mesh: Any) -> np.ndarray:
    if not hasattr(links, "array"):
        return np.asarray(links)
    index_map = mesh.topology.index_map(mesh.topology.dim)
    return links.array.reshape(index_map.size_local + index_map.num_ghosts, -1)


def coordinate_element(mesh: Any) -> Any:
    """UFL element of the mesh's own geometry (its nodes are equispaced, unlike high-order Lagrange spaces)."""
    return mesh.ufl_domain().ufl_coordinate_element()


def geometry_degree(mesh: Any) -> int:
    """Polynomial degree of the mesh's cells."""
    degree = coordinate_element(mesh).degree
    return int(degree() if callable(degree) else degree)


def scalar_part(vector_element: Any) -> Any:
    """The element of one component of a vector element."""
    parts = vector_element.sub_elements
    return (parts() if callable(parts) else parts)[0]


def interpolation_points(function_space: Any) -> np.ndarray:
    """Reference points at which a function is evaluated when it is interpolated into the space."""
    points = function_space.element.interpolation_points
    return points() if callable(points) else points


def vec_view(function: Any) -> Any:
    """PETSc vector sharing memory, ghosts included, with a dolfinx function."""
    space = function.function_space
    index_map, block = space.dofmap.index_map, space.dofmap.index_map_bs
    ghosts = index_map.ghosts.astype(PETSc.IntType)
    size = (index_map.size_local * block, None)
    return PETSc.Vec().createGhostWithArray(
        ghosts, function.x.array, size=size, bsize=block, comm=space.mesh.comm
    )


def cell_size(mesh: Any, cells: np.ndarray) -> np.ndarray:
    """Size of each given local cell: the largest distance between two of its vertices."""
    if hasattr(mesh, "h"):
        return mesh.h(mesh.topology.dim, cells)
    return dolfinx.cpp.mesh.h(mesh._mesh if hasattr(mesh, "_mesh") else mesh, mesh.topology.dim, cells)


def cells_at(mesh: Any, points: np.ndarray) -> np.ndarray:
    """(n,) a local cell that holds each of the (n, 3) points, -1 where no local cell does. Not collective.

    Cells are simplices. The library's own collision test (of 0.5.2) can name a neighbour of the right cell,
    in which a polynomial is then extrapolated; here the reference coordinates decide.
    """
    geometry = dolfinx.geometry
    make = getattr(geometry, "bb_tree", None) or geometry.BoundingBoxTree
    tree = make(mesh, mesh.topology.dim, padding=1e-12)
    collide = getattr(geometry, "compute_collisions_points", None) or geometry.compute_collisions
    candidates = collide(tree, points)
    return np.array([_holder(mesh, x, candidates.links(i)) for i, x in enumerate(points)], dtype=np.int32)


def _holder(mesh: Any, point: np.ndarray, candidates: Any, tolerance: float = 1e-9) -> int:
    """The candidate cell in which the point lies deepest, -1 if it lies in none."""
    best, depth = -1, -tolerance
    for cell in candidates:
        inside = _depth(mesh, point, int(cell))
        if inside > depth:
            best, depth = int(cell), inside
    return best


def _depth(mesh: Any, point: np.ndarray, cell: int) -> float:
    """Smallest barycentric coordinate of the point in a cell; -inf where the cell's map has no inverse."""
    gdim = mesh.geometry.dim
    cmap = getattr(mesh.geometry, "cmaps", None)
    cmap = mesh.geometry.cmap if cmap is None or callable(cmap) else cmap[0]
    nodes = mesh.geometry.x[_geometry_links(mesh, cell), :gdim]
    try:
        reference = cmap.pull_back(np.array(point[None, :gdim]), np.array(nodes))
    except RuntimeError:
        return -np.inf
    return float(min(reference.min(), 1.0 - reference.sum()))


def _geometry_links(mesh: Any, cell: int) -> np.ndarray:
    dofmaps = getattr(mesh.geometry, "dofmaps", None)
    table = dofmaps[0] if dofmaps is not None else mesh.geometry.dofmap
    return table.links(cell) if hasattr(table, "links") else table[cell]


def versions() -> dict[str, str]:
    """Versions of the libraries a result depends on."""
    import importlib.metadata
    import platform

    petsc = ".".join(map(str, PETSc.Sys.getVersion()))
    return {
        "incipient": importlib.metadata.version("incipient"),
        "dolfinx": dolfinx.__version__,
        "ufl": importlib.metadata.version("fenics-ufl"),
        "petsc": petsc,
        "python": platform.python_version(),
        "numpy": np.__version__,
    }
