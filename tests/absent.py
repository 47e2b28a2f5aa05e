"""Runs a scene of which some effects are absent, in a process of its own, and tells what was used.

`python absent.py SCENE TERMS [DIRECTORY]`: TERMS of the flow's equations, with commas, are taken out of the program.
Prints JSON: modules imported, unknowns, and those of each effect.
"""

from __future__ import annotations

import json
import sys

# Modules that are for one effect only.
OF_UNSTEADINESS = ("simulation.time_loop", "fluid.transient")
OF_MOVING_MESH = (
    "mesh.motion",
    "coupled.remeshing",
    "coupled.moving_grain",
)
OF_FREE_BODY = (
    "coupled.coupling",
    "coupled.rigid",
    "body.rigidbody",
    "body.rkf45",
)
OF_FREE_SURFACE = (
    "forms.surface",
    "fluid.surface",
    "mesh.elevation",
    "coupled.surface",
    "coupled.moving_surface",
)
OF_TURBULENCE = (
    "forms.turbulence",
    "forms.k_omega_sst",
    "fluid.friction",
    "turbulence",
    "coupled.turbulent_flow",
    "mesh.wall_distance",
    "results.wall_report",
)
OF_CONTACT = ("contact",)
OF_ESTIMATES = (
    *(f"accuracy.{name}" for name in ("errorbars", "terms", "dual", "goal", "coarse_runs")),
    *(f"accuracy.{name}" for name in ("search", "searches", "first_mesh")),
)
OF_CHECKPOINTS = ("restart",)
MODULES = (
    *(*OF_UNSTEADINESS, *OF_MOVING_MESH, *OF_FREE_BODY, *OF_FREE_SURFACE, *OF_TURBULENCE),
    *(*OF_CONTACT, *OF_ESTIMATES, *OF_CHECKPOINTS),
)
# Terms of the flow's equations that a steady flow without inertia does not have.
TERMS = ("inertia", "convection")


def main(scene: str, taken_out: str, directory: str | None = None) -> None:
    """Run the scene; results go to a directory if one is given."""
    import incipient
    from incipient.forms import terms

    for name in filter(None, taken_out.split(",")):
        delattr(terms, name)
    cost = incipient.run(incipient.load(scene), directory).cost
    imported = [m.removeprefix("incipient.") for m in sys.modules if m.startswith("incipient.")]
    effects = {name: share["unknowns"] for name, share in cost["effects"].items()}
    print(json.dumps({"modules": imported, "unknowns": cost["unknowns"], "effects": effects}))


if __name__ == "__main__":
    main(*sys.argv[1:])
