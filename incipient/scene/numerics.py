"""The section [numerics]."""

from typing import Annotated, Literal

from pydantic import Field

from .section import Positive, Section, key

ORDERS = (2, 3, 4)
MESH_SIZES = (0.01, 100.0)  # range of mesh_size

# Quantities of a free surface: elevations in the course of the run, and at its end.
OF_SURFACE = ("elevation", "level")
# The quantity of the walls of a turbulent flow: u* at the outflow, or its mean if the bed is not planar.
OF_WALLS = "shear velocity"
# Below this the curved cells' geometry errs as much, which no estimate includes (docs/contribute/defaults.md).
FINEST = 1e-5
Accuracy = Annotated[float, Field(ge=FINEST, lt=1)] | Literal["verdict"] | None
Tolerance = Positive | Literal["auto"]


class Numerics(Section):
    """How the equations are solved; every key is optional."""

    order: Literal["auto", 2, 3, 4] = key(
        "Order of the velocity, the pressure's less one; "
        "auto: 3 if nothing moves, in 3-D in creeping flow, otherwise 2",
        "auto",
    )
    geometry_order: int | None = key(
        "Order of curved cells, 1 to 3; default: chosen", None, ge=1, le=3, examples=[2]
    )
    mesh_size: float = key(
        "Factor on the size of all cells; 0.5 halves them [-]",
        1.0,
        ge=MESH_SIZES[0],
        le=MESH_SIZES[1],
    )
    max_cells: int = key("Largest expected number of triangles of a mesh", 1_000_000, ge=1)
    convection: Literal["implicit", "extrapolated"] = key(
        "Convection by Newton iteration, or linearised about earlier steps", "implicit"
    )
    stabilisation: Literal["auto", "on", "off"] = key(
        "Stabilised convection on coarse cells; auto: where the cell Reynolds number requires it",
        "auto",
    )
    meshed_bed: Positive = key(
        "Factor on the radius about the grain within which the forms of a 3-D bed are meshed [-]",
        1.0,
    )
    error_bars: bool = key(
        "Estimate errors of force, torque, safety factor, elevations and, with turbulence, u*; takes about "
        "as long as the run",
        True,
    )
    correction: bool = key(
        "Correct force and torque on a grain for estimated errors of known sign; error bars are then those "
        "of the corrected values",
        True,
    )
    accuracy: Accuracy = key(
        'Requested relative error, or "verdict": until the verdict is conclusive; the mesh is then chosen',
        None,
        examples=[0.01],
    )
    accuracy_of: Literal[
        "auto", "force", "torque", "safety factor", "elevation", "level", "shear velocity"
    ] = key(
        "Quantity to which `accuracy` applies; auto: force; without a grain elevation, with turbulence "
        "shear velocity",
        "auto",
    )
    accuracy_includes: Literal["discretisation", "all"] = key(
        "Errors included in `accuracy`; all: also of gap and domain, which are then chosen",
        "discretisation",
    )
    budget_seconds: Positive | None = key(
        "Wall time of the search for `accuracy` [s]", None, examples=[60.0]
    )
    budget_mib: Positive | None = key(
        "Memory of the search for `accuracy` [MiB]", None, examples=[2000.0]
    )
    interface_tolerance: Tolerance = key(
        "Error of a moving grain's equation of motion relative to its load; auto: as tolerance [-]",
        "auto",
    )
    remesh_below: float = key(
        "Quality of the worst cell, relative to that of a new mesh, below which to remesh",
        0.35,
        gt=0,
        lt=1,
    )
    tolerance: Tolerance = key(
        "Relative error of iterations; auto: steady 1e-6, with k-omega SST 1e-4, unsteady 0.1 of a step's own "
        "error [-]",
        "auto",
    )
    max_iterations: int = key("Largest number of Newton updates", 25, ge=1)
