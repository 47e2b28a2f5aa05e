"""Runs a scene of which some effects are absent, with their code there or taken out, and tells what was used.

In processes of its own: `python absent.py SCENE there|taken-out RUNS`. Prints JSON: calls of Python and C functions in
the last run (of the interpreter, counted, not timed), modules imported, forms compiled, unknowns, force.
"""

from __future__ import annotations

import json
import sys
from typing import Any

# Modules that are for one effect only.
OF_UNSTEADINESS = ("fluid.transient", "fluid.quasisteady")
OF_MOVING_MESH = (
    "meshmotion",
    "remeshing",
    "transfer",
    "trajectory",
    "energy",
    "redistribution",
    "resumption",
)
OF_FREE_BODY = ("coupling", "rigidbody", "integrator", "fehlberg")
OF_CONTACT = ("judgement", "contact")
OF_ESTIMATES = ("errorbars", "dual", "adaptation")
MODULES = (*OF_UNSTEADINESS, *OF_MOVING_MESH, *OF_FREE_BODY, *OF_CONTACT, *OF_ESTIMATES)
# Terms of the flow's equations that a steady flow without inertia does not have.
TERMS = ("inertia", "convection", "skew_convection", "through_boundary")


class TakenOut:
    """Finds no module of an absent effect."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> None:
        """Refuse what is taken out, and leave the rest to others."""
        if any(
            name == f"incipient.{module}" or name.startswith(f"incipient.{module}.") for module in MODULES
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


def main(scene: str, state: str, runs: str) -> None:
    """Run the scene, and count in the last of the runs: the first imports modules and compiles forms."""
    if state == "taken-out":
        take_out()
    import dolfinx

    import incipient

    compiled: list[str] = []
    original = dolfinx.jit.ffcx_jit

    def listed(comm: Any, form: Any, *rest: Any, **options: Any) -> Any:
        compiled.append(form.signature() if hasattr(form, "signature") else repr(form))
        return original(comm, form, *rest, **options)

    dolfinx.jit.ffcx_jit = listed
    loaded = incipient.load(scene)
    for run in range(int(runs)):
        compiled.clear()
        if run + 1 < int(runs):
            incipient.run(loaded)
            continue
        with Calls() as calls:
            result = incipient.run(loaded)
    found = {
        "calls": calls.number,
        "modules": sorted(m.removeprefix("incipient.") for m in sys.modules if m.startswith("incipient.")),
        "forms": sorted(set(compiled)),
        "number_of_forms": len(compiled),
        "unknowns": result.cost["unknowns"],
        "effects": {name: share["unknowns"] for name, share in result.cost["effects"].items()},
        "force": list(result.force.flow),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
