"""The meshed fluid domain with its named boundaries, built on rank 0 and distributed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

import dolfinx
import numpy as np
import ufl
from mpi4py import MPI

from .. import compat
from ..arrays import Integers, unordered_keys
from ..errors import MeshError
from ..meshes import SYMMETRY
from ..parallel import collectively
from .cells import cell_facets, local_cells


@dataclass(frozen=True)
class Domain:
    """A distributed mesh whose boundary facets carry names ("inflow", "bed", "body", ...)."""

    mesh: Any
    facets: Any
    names: dict[str, int]

    @property
    def gdim(self) -> int:
        """Dimension of space, two or three."""
        return int(self.mesh.geometry.dim)

    @property
    def comm(self) -> MPI.Comm:
        """The communicator the mesh lives on."""
        return self.mesh.comm

    @property
    def halved(self) -> bool:
        """Whether this is half of a domain that is its own mirror image, cut in a plane of constant y."""
        return SYMMETRY in self.names

    def facets_of(self, name: str) -> np.ndarray:
        """Local facets (ghosts included) of a named boundary; empty on ranks without any."""
        return self.facets.find(self.names[name])

    def measure(self, *names: str) -> Any:
        """UFL surface measure over the named boundaries together."""
        tags = tuple(self.names[name] for name in names)
        return ufl.Measure("ds", domain=self.mesh, subdomain_data=self.facets)(
            tags[0] if len(tags) == 1 else tags
        )


def build(comm: MPI.Comm, drawing: Callable[[], AbstractContextManager[Any]], gdim: int) -> Domain:
    """Draw and mesh on rank 0, then distribute. Collective.

    `drawing()` is a context manager that yields a meshed gmsh model in which every boundary facet
    belongs to one named physical group; it is entered on rank 0 only.

    Raises:
        MeshError: on all ranks, when the geometry cannot be meshed or part of the boundary has no name.
    """
    with _drawn(comm, drawing) as model:
        mesh, facets = mesh_of(model, comm, gdim)
        names = comm.bcast(_group_names(model, gdim - 1) if comm.rank == 0 else None, root=0)
    domain = Domain(mesh, facets, names)
    _check_boundary(domain)
    return domain


def mesh_of(model: Any, comm: MPI.Comm, gdim: int) -> tuple[Any, Any]:
    """The mesh of the gmsh model on rank 0, and the tags of its facets by physical groups. Collective."""
    empty = np.empty((0, gdim))
    nodes, cells, order = _cells_of(model, gdim) if comm.rank == 0 else (empty, empty, 0)
    known = (order, cells.shape[1], *_facets_of(model, gdim)) if comm.rank == 0 else None
    order, per_cell, corners, tags = comm.bcast(known, root=0)
    cells = cells.astype(np.int64).reshape(-1, per_cell)
    mesh = compat.create_mesh(comm, cells[:, compat.gmsh_order(gdim, per_cell)], nodes, order)
    return mesh, named_facets(mesh, corners, tags)


def _cells_of(model: Any, gdim: int) -> tuple[np.ndarray, np.ndarray, int]:
    """The nodes (n, gdim) of a gmsh model, its cells (m, nodes per cell) and their order."""
    tags, places, _ = model.mesh.getNodes()
    nodes = np.reshape(places, (-1, 3))[np.argsort(tags), :gdim]
    (kind,), _, (members,) = model.mesh.getElements(gdim)
    _, _, order, per_cell, _, _ = model.mesh.getElementProperties(kind)
    return nodes.copy(), members.reshape(-1, per_cell).astype(np.int64) - 1, order


def _facets_of(model: Any, gdim: int) -> tuple[np.ndarray, np.ndarray]:
    """The corners (k, gdim) of the facets in physical groups of a gmsh model, and the groups' tags (k,)."""
    corners, tags = [np.empty((0, gdim), dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    for _, tag in model.getPhysicalGroups(gdim - 1):
        for entity in model.getEntitiesForPhysicalGroup(gdim - 1, tag):
            for kind, _, members in zip(*model.mesh.getElements(gdim - 1, entity), strict=True):
                per_facet = model.mesh.getElementProperties(kind)[3]
                corners.append(members.reshape(-1, per_facet)[:, :gdim].astype(np.int64) - 1)
                tags.append(np.full(len(corners[-1]), tag))
    return np.concatenate(corners), np.concatenate(tags)


@contextmanager
def _drawn(comm: MPI.Comm, drawing: Callable[[], AbstractContextManager[Any]]) -> Iterator[Any]:
    """Enter the drawing on rank 0; an error in it is raised on all ranks."""
    with ExitStack() as stack:
        model = None
        with collectively(comm):
            if comm.rank == 0:
                model = stack.enter_context(drawing())
        yield model


def _group_names(model: Any, dimension: int) -> dict[str, int]:
    groups = model.getPhysicalGroups(dimension)
    return {model.getPhysicalName(dimension, tag): tag for _, tag in groups}


def _check_boundary(domain: Domain) -> None:
    """Every exterior facet must be named once: a facet left out would silently be an open boundary."""
    exterior = compat.exterior_facets(domain.mesh)
    unnamed = np.setdiff1d(exterior, domain.facets.indices)
    missing = domain.comm.allreduce(len(unnamed))
    if missing:
        raise MeshError(f"{missing} boundary facets of the mesh belong to no named boundary")


def named_facets(mesh: Any, corners: Integers, tags: Integers) -> Any:
    """The tags (k,) of facets whose corners were given as nodes of numbers (k, gdim), as tags of the mesh.

    All ranks know all of these facets; tagged are those that they have, also of ghosts. Those that the mesh does not
    have are left out. Collective.
    """
    dimension = mesh.topology.dim
    facets, rows = cell_facets(mesh, local_cells(mesh))
    numbers, wanted = np.unique(corners, return_inverse=True)
    wanted = unordered_keys(wanted.reshape(-1, dimension), len(numbers))
    order = np.argsort(wanted, kind="stable")
    position = _positions(numbers, np.asarray(mesh.geometry.input_global_indices, dtype=np.int64))[
        rows
    ]
    among = (position >= 0).all(axis=1)
    found = _positions(wanted[order], unordered_keys(position[among], len(numbers)))
    named, first = np.unique(facets[among][found >= 0], return_index=True)
    values = tags[order][found[found >= 0]][first]
    return dolfinx.mesh.meshtags(
        mesh, dimension - 1, named.astype(np.int32), values.astype(np.int32)
    )


def _positions(ascending: Integers, numbers: Integers) -> Integers:
    """Where numbers (n,) stand among ascending ones, (n,); -1 where they do not."""
    if not len(ascending):
        return np.full(len(numbers), -1)
    position = np.minimum(np.searchsorted(ascending, numbers), len(ascending) - 1)
    return np.where(ascending[position] == numbers, position, -1)
