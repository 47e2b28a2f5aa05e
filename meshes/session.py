"""Sessions of gmsh."""

import inspect
from collections.abc import Iterator
from contextlib import contextmanager

from incipient.arrays import Floats
from incipient.errors import MeshError
from incipient.interrupt import handlers_kept

with handlers_kept():  # at its import gmsh takes interrupts for itself
    import gmsh

REMEDY = "use another numerics.mesh_size, and make thin parts and narrow passages such as contact.gap wider"


@contextmanager
def session() -> Iterator[None]:
    """A quiet gmsh session with an empty model; gmsh's complaints are MeshErrors."""
    known = inspect.signature(gmsh.initialize).parameters
    with handlers_kept():
        gmsh.initialize(**({"interruptible": False} if "interruptible" in known else {}))
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.logger.start()
        gmsh.model.add("incipient")
        yield
    except Exception as error:
        if type(error) is not Exception:  # gmsh raises the base class of all others
            raise
        reason = str(error) or type(error).__name__
        raise MeshError(f"the geometry could not be meshed: {reason}; {REMEDY}") from error
    finally:
        with handlers_kept():
            gmsh.finalize()


def generate(dimension: int) -> None:
    """Mesh the drawing. Raises MeshError if gmsh complains in its log, or makes no cells."""
    # Exceptions thrown from inside the mesher end the process: let it stop at its first error, and look.
    gmsh.option.setNumber("General.AbortOnError", 1)
    said = len(gmsh.logger.get())
    gmsh.model.mesh.generate(dimension)
    complaints = [line for line in gmsh.logger.get()[said:] if line.startswith("Error")]
    if complaints or len(gmsh.model.mesh.getElements(dimension)[0]) == 0:
        reason = complaints[0].removeprefix("Error: ") if complaints else "gmsh made no cells"
        raise MeshError(f"the geometry could not be meshed: {reason}; {REMEDY}")


def set_background(field: int) -> None:
    """Take cell sizes from a field alone."""
    gmsh.model.mesh.field.setAsBackgroundMesh(field)
    for option in ("FromPoints", "ExtendFromBoundary", "FromCurvature"):
        gmsh.option.setNumber("Mesh.MeshSize" + option, 0)


def view_field(kind: str, rows: Floats) -> int:
    """A field of sizes, linear on triangles ("ST") or hexahedra ("SH"), from rows of gmsh's views."""
    view, fields = gmsh.view.add("sizes"), gmsh.model.mesh.field
    gmsh.view.addListData(view, kind, len(rows), rows.ravel())
    field = fields.add("PostView")
    fields.setNumber(field, "ViewTag", view)
    return int(field)
