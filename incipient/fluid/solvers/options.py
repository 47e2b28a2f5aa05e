"""PETSc options that hold where the user has given none."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from petsc4py import PETSc


@contextmanager
def defaults(prefix: str, chosen: Mapping[str, Any]) -> Iterator[None]:
    """Within the block the options chosen hold for a prefix, but for those that the user has given."""
    options = PETSc.Options(prefix)
    added = {name: value for name, value in chosen.items() if not options.hasName(name)}
    for name, value in added.items():
        options.setValue(name, value)
    try:
        yield
    finally:
        for name in added:
            options.delValue(name)


def exact(prefix: str = "") -> dict[str, str]:
    """Options of a solution by factors, by MUMPS where PETSc has it; without it on one rank."""
    found = {f"{prefix}pc_type": "lu"}
    if PETSc.Sys.hasExternalPackage("mumps"):
        found[f"{prefix}pc_factor_mat_solver_type"] = "mumps"
    return found
