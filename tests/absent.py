"""Runs a scene of which some effects are absent, with their code there or taken out, and tells what was used.

In processes of its own: `python absent.py SCENE there|taken-out calls|nothing [DIRECTORY]`. The scene is run
twice; in the second run, which imports and compiles nothing any more, calls of Python and C functions by the
interpreter are counted.
Prints JSON: calls, modules imported, forms compiled, unknowns, force.
"""

from __future__ import annotations

import json
import sys
from contextlib import nullcontext
from typing import Any

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


class TakenOut:
    """Finds no module of an absent effect."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> None:
        """Refuse what is taken out, and leave the rest to others."""
        if any(
            name == f"incipient.{module}" or name.startswith(f"incipient.{module}.")
            for module in MODULES
        ):
            raise ModuleNotFoundError(f"{name} is taken out")


def take_out() -> None:
    """Take the code of the absent effects out of the program."""
    sys.meta_path.insert(0, TakenOut())
    from incipient.forms import terms

    for name in TERMS:
        delattr(terms, name)


class Calls:
    """Counts calls of Python functions and of C functions while it is open."""

    number = 0

    def _count(self, frame: Any, event: str, argument: Any) -> None:
        self.number += event in ("call", "c_call")

    def __enter__(self) -> Calls:
        sys.setprofile(self._count)
        return self

    def __exit__(self, *exception: object) -> None:
        sys.setprofile(None)


def main(scene: str, state: str, counted: str, directory: str | None = None) -> None:
    """Run the scene twice, and count in the second run; results go to a directory if one is given."""
    if state == "taken-out":
        take_out()
    from mpi4py import MPI  # noqa: F401 (PyPI's dolfinx finds its MPI only then)

    # isort: split
    import dolfinx

    import incipient

    compiled: list[str] = []
    original = dolfinx.jit.ffcx_jit

    def listed(comm: Any, form: Any, *rest: Any, **options: Any) -> Any:
        compiled.append(form.signature() if hasattr(form, "signature") else repr(form))
        return original(comm, form, *rest, **options)

    dolfinx.jit.ffcx_jit = listed
    loaded = incipient.load(scene)
    incipient.run(loaded, directory)
    compiled.clear()
    counters = {"calls": Calls, "nothing": nullcontext}
    with counters[counted]() as calls:
        result = incipient.run(loaded, directory)
    found = {
        "calls": calls and calls.number,
        "modules": sorted(
            m.removeprefix("incipient.") for m in sys.modules if m.startswith("incipient.")
        ),
        "forms": sorted(set(compiled)),
        "number_of_forms": len(compiled),
        "unknowns": result.cost["unknowns"],
        "effects": {name: share["unknowns"] for name, share in result.cost["effects"].items()},
        "force": list(result.force.flow),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
