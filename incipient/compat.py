"""Differences between the supported versions of dolfinx (0.5.2 to 0.11), chosen by features."""

from __future__ import annotations

import hashlib
import importlib.metadata
import inspect
import logging
import platform
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from . import form_cache
from .installed import arguments_of_text, required, versions_without_setuptools
from .interrupt import handlers_kept

# isort: off
# In this order: PyPI's dolfinx does not find MPI by itself, and h5py works only if its copy of HDF5 is loaded before
# PETSc's. Other modules import `petsc` from here.
from mpi4py import MPI
import h5py  # noqa: F401

with versions_without_setuptools(), arguments_of_text(), handlers_kept():
    import basix
    import dolfinx
    import ufl
    from dolfinx.fem import petsc
    from petsc4py import PETSc

    if not hasattr(ufl, "FiniteElement"):
        import basix.ufl
# isort: on

ADD = dolfinx.la.InsertMode.add if hasattr(dolfinx.la, "InsertMode") else dolfinx.la.ScatterMode.add


def element(mesh: Any, degree: int, shape: tuple[int, ...] = (), family: str = "Lagrange") -> Any:
    """Element of a family on the mesh's cells, for values of a shape, () for scalars."""
    cell = (
        mesh.topology.cell_name()
        if hasattr(mesh.topology, "cell_name")
        else mesh.ufl_cell().cellname()
    )
    if hasattr(ufl, "FiniteElement"):
        if not shape:
            return ufl.FiniteElement(family, cell, degree)
        return ufl.VectorElement(family, cell, degree, dim=shape[0])
    return basix.ufl.element(family, cell, degree, shape=shape)


def mixed_element(parts: list[Any]) -> Any:
    """Mixed element."""
    if hasattr(ufl, "MixedElement"):
        return ufl.MixedElement(parts)
    return basix.ufl.mixed_element(parts)


def function_space(mesh: Any, any_element: Any) -> Any:
    """Function space of an element, also of a coordinate element."""
    make = getattr(dolfinx.fem, "functionspace", None) or dolfinx.fem.FunctionSpace
    return _compiled(
        make, repr(any_element), mesh.comm, lambda keys: make(mesh, any_element, **keys)
    )


def space(mesh: Any, degree: tuple[str, int], shape: tuple[int, ...] = ()) -> Any:
    """Function space such as `space(mesh, ("Lagrange", 2), (2,))`. Collective."""
    family, order = degree
    return function_space(mesh, element(mesh, order, shape, family))


def form(expression: Any, compiler: dict[str, Any] | None = None) -> Any:
    """Compile a UFL form. Collective; cached on disk. Raises MissingError without a C compiler."""
    keyword = "form_compiler_options"
    if keyword not in inspect.signature(dolfinx.fem.form).parameters:
        keyword = "form_compiler_params"
    options, make = {keyword: dict(compiler or {})}, dolfinx.fem.form
    comm, signature = (
        expression.ufl_domains()[0].ufl_cargo().comm,
        f"{expression.signature()}{options}",
    )
    return _compiled(make, signature, comm, lambda keys: make(expression, **options, **keys))


def interpolate(function: Any, expression: Any) -> None:
    """Interpolate a UFL expression into a function. Collective; raises as `form`."""
    from ffcx.naming import compute_signature

    space, make = function.function_space, dolfinx.fem.Expression
    points = interpolation_points(space)
    signature = compute_signature([(expression, points)], "")
    function.interpolate(
        _compiled(make, signature, space.mesh.comm, lambda keys: make(expression, points, **keys))
    )


@contextmanager
def quiet_compiler() -> Iterator[None]:
    """Suppress reports and warnings of the form and C compilers, and keep the root logger's level."""
    level, disabled = logging.getLogger().level, logging.root.manager.disable
    logging.disable(logging.INFO)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Number of integration points per cell", UserWarning)
            yield
    finally:
        logging.disable(disabled)
        logging.getLogger().setLevel(level)  # changed by builds


def _compiled(
    compiled_by: Any, signature: str, comm: MPI.Comm, make: Callable[[dict[str, Any]], Any]
) -> Any:
    settings = getattr(dolfinx.jit, "get_options", None) or dolfinx.jit.get_parameters
    keyword = "jit_options" if hasattr(dolfinx.jit, "get_options") else "jit_params"
    with required(), quiet_compiler():
        if keyword not in inspect.signature(compiled_by).parameters:
            return make({})
        chosen = settings()
        inputs = (
            compiled_by.__name__,
            signature,
            dolfinx.__version__,
            sys.implementation.cache_tag,
            chosen,
        )
        name = hashlib.sha1(str(inputs).encode(), usedforsecurity=False).hexdigest()
        root = Path(chosen["cache_dir"]) / "incipient"
        return form_cache.compiled(
            root, name, comm, lambda folder: make({keyword: {"cache_dir": folder}})
        )


def gmsh_order(gdim: int, nodes: int) -> np.ndarray:
    """Order (nodes,) of gmsh's nodes of a triangle or tetrahedron in dolfinx."""
    cell = {2: dolfinx.mesh.CellType.triangle, 3: dolfinx.mesh.CellType.tetrahedron}[gdim]
    return np.asarray(dolfinx.cpp.io.perm_gmsh(cell, nodes), dtype=np.int64)


def vtk_order(dimension: int, nodes: int) -> np.ndarray:
    """Positions (nodes,) in dolfinx's order of VTK's nodes of an interval, triangle or tetrahedron."""
    types = dolfinx.mesh.CellType
    cell = (types.interval, types.triangle, types.tetrahedron)[dimension - 1]
    return np.argsort(dolfinx.cpp.io.perm_vtk(cell, nodes))


def partitioner() -> Any:
    """Cell partitioner whose ghosts share a facet (the default of 0.5.2 only)."""
    mode = dolfinx.mesh.GhostMode.shared_facet
    for arguments in ((mode,), (mode, 2)):
        try:
            return dolfinx.mesh.create_cell_partitioner(*arguments)
        except TypeError:
            continue
    return dolfinx.mesh.create_cell_partitioner()


def create_mesh(comm: MPI.Comm, cells: np.ndarray, nodes: np.ndarray, degree: int) -> Any:
    """Mesh of simplices of a degree, ghosted across shared facets. Collective.

    Each rank gives a part of the cells (n, nodes per cell), in dolfinx's order, and of the nodes (n, gdim).
    """
    gdim = nodes.shape[1]
    cell = {2: "triangle", 3: "tetrahedron"}[gdim]
    make, keywords = dolfinx.mesh.create_mesh, {"partitioner": partitioner()}
    if hasattr(ufl, "VectorElement"):
        vectors = ufl.VectorElement("Lagrange", cell, degree, dim=gdim, variant="equispaced")
        keywords["domain"] = ufl.Mesh(vectors)
    else:
        variant = basix.LagrangeVariant.equispaced
        keywords["e"] = basix.ufl.element("Lagrange", cell, degree, variant, shape=(gdim,))
    return make(comm, cells=cells, x=nodes, **keywords)


def exterior_facets(mesh: Any) -> np.ndarray:
    """Local indices of the owned boundary facets. Collective."""
    dimension = mesh.topology.dim
    mesh.topology.create_connectivity(dimension - 1, dimension)
    return dolfinx.mesh.exterior_facet_indices(mesh.topology)


def cell_dofs(function_space: Any) -> np.ndarray:
    """Block degrees of freedom (cells, nodes per cell) of all local cells, ghosts included."""
    return _table(function_space.dofmap.list, function_space.mesh)


def geometry_dofs(mesh: Any) -> np.ndarray:
    """Rows (cells, nodes per cell) of `mesh.geometry.x` of all local cells, ghosts included."""
    dofmaps = getattr(mesh.geometry, "dofmaps", None)
    return _table(dofmaps[0] if dofmaps is not None else mesh.geometry.dofmap, mesh)


def _table(links: Any, mesh: Any) -> np.ndarray:
    if not hasattr(links, "array"):
        return np.asarray(links)
    index_map = mesh.topology.index_map(mesh.topology.dim)
    return links.array.reshape(index_map.size_local + index_map.num_ghosts, -1)


def coordinate_element(mesh: Any) -> Any:
    """UFL element of the mesh's geometry, with equispaced nodes unlike high-order Lagrange spaces."""
    return mesh.ufl_domain().ufl_coordinate_element()


def geometry_degree(mesh: Any) -> int:
    """Polynomial degree of the mesh's cells."""
    degree = coordinate_element(mesh).degree
    return int(degree() if callable(degree) else degree)


def scalar_part(vector_element: Any) -> Any:
    """Element of one component of a vector element."""
    parts = vector_element.sub_elements
    return (parts() if callable(parts) else parts)[0]


def interpolation_points(function_space: Any) -> np.ndarray:
    """Reference points of interpolation into the space."""
    points = function_space.element.interpolation_points
    return points() if callable(points) else points


def tabulate(function_space: Any, reference: np.ndarray) -> np.ndarray:
    """Shape functions (n, nodes) of a scalar space, or a component, at reference points; nodes as in `cell_dofs`."""
    return function_space.element.basix_element.tabulate(0, reference)[0, :, :, 0]


def nodes_on(spaces: Any, facets: np.ndarray) -> Any:
    """Local nodes (blocks) of a space on facets, shared nodes included; of two spaces their pairs. Collective.

    The cells at the facets must be known: only 0.5.2 determines them itself.
    """
    topology = (spaces[0] if isinstance(spaces, tuple) else spaces).mesh.topology
    dimension = topology.dim - 1
    topology.create_connectivity(dimension, topology.dim)
    return dolfinx.fem.locate_dofs_topological(spaces, dimension, facets)


def interpolation_matrix(coarse: Any, fine: Any) -> Any:
    """PETSc matrix of interpolation between two spaces on one mesh. Collective."""
    make = getattr(petsc, "interpolation_matrix", None)
    if make is not None:
        matrix = make(coarse, fine)
    else:
        spaces = [getattr(space, "_cpp_object", space) for space in (coarse, fine)]
        matrix = dolfinx.cpp.fem.petsc.interpolation_matrix(*spaces)
    matrix.assemble()
    return matrix


def matrix_of(compiled: Any, conditions: Sequence[Any] = (), matrix: Any = None) -> Any:
    """Assemble the PETSc matrix of a bilinear form, a new one or `matrix`. Collective."""
    if matrix is None:
        matrix = petsc.create_matrix(compiled)
    matrix.zeroEntries()
    petsc.assemble_matrix(matrix, compiled, list(conditions))
    matrix.assemble()
    return matrix


def vector_of(compiled: Any, vector: Any = None) -> Any:
    """Assemble the PETSc vector of a linear form, a new one or `vector`. Collective."""
    if vector is None:
        vector = petsc.assemble_vector(compiled)
    else:
        with vector.localForm() as local:
            local.set(0.0)
        petsc.assemble_vector(vector, compiled)
    vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    return vector


def integral(compiled: Any, comm: MPI.Comm) -> float:
    """Integral of a form without test functions. Collective."""
    return float(comm.allreduce(float(np.real(dolfinx.fem.assemble_scalar(compiled)))))


def owned_entries(compiled: Any) -> np.ndarray:
    """Owned entries of the vector of a linear form. Collective."""
    vector = vector_of(compiled)
    entries = vector.array_r.copy()
    vector.destroy()
    return np.asarray(entries)


def set_zero(vector: Any, conditions: list[Any]) -> None:
    """Zero a PETSc vector at Dirichlet conditions.

    The factor is positional: its name is `scale` in 0.5.2 and `alpha` later.
    """
    petsc.set_bc(vector, conditions, None, 0.0)


def impose(values: np.ndarray, conditions: list[Any]) -> None:
    """Put Dirichlet values into local values (unknowns,), ghosts included."""
    if hasattr(dolfinx.fem, "set_bc"):
        dolfinx.fem.set_bc(values, conditions)
        return
    for condition in conditions:
        condition.set(values)


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
    """Largest distance between two vertices of each local cell."""
    if hasattr(mesh, "h"):
        return mesh.h(mesh.topology.dim, cells)
    return dolfinx.cpp.mesh.h(
        mesh._mesh if hasattr(mesh, "_mesh") else mesh, mesh.topology.dim, cells
    )


def versions() -> dict[str, str]:
    """Versions of the libraries on which a result depends."""
    petsc = ".".join(map(str, PETSc.Sys.getVersion()))
    return {
        "incipient": importlib.metadata.version("incipient"),
        "dolfinx": dolfinx.__version__,
        "ufl": importlib.metadata.version("fenics-ufl"),
        "petsc": petsc,
        "python": platform.python_version(),
        "numpy": np.__version__,
    }
