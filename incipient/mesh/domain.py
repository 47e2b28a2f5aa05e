"""The meshed fluid domain with its named boundaries, built on rank 0 and distributed."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI

from .. import compat
from ..errors import MeshError
from ..meshes.solid_region import SYMMETRY
from ..parallel import collectively


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
    with _Drawn(comm, drawing) as model:
        mesh, _, facets = compat.model_to_mesh(model, comm, gdim)
        names = comm.bcast(_group_names(model, gdim - 1) if comm.rank == 0 else None, root=0)
    domain = Domain(mesh, facets, names)
    _check_boundary(domain)
    return domain


class _Drawn:
    """Enters the drawing on rank 0; an error in it is raised on all ranks."""

    def __init__(self, comm: MPI.Comm, drawing: Callable[[], AbstractContextManager[Any]]):
        self.comm, self.drawing = comm, drawing
        self.context: AbstractContextManager[Any] | None = None

    def __enter__(self) -> Any:
        model = None
        with collectively(self.comm):
            if self.comm.rank == 0:
                self.context = self.drawing()
                model = self.context.__enter__()
        return model

    def __exit__(self, *exception: Any) -> None:
        if self.context is not None:
            self.context.__exit__(*exception)


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
