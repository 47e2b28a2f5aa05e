"""The sections of what was computed, what was left out, and what it took."""

from __future__ import annotations

from typing import Any

from ..planning.effects import percent
from ..results.left_out import Omission
from .page import PageSection, Rows, section, table, words

TRIED = (
    "cells",
    "unknowns",
    "estimate",
    "step",
    "seconds",
    "note",
)  # of each mesh, after its order


def of_plan(plan: dict[str, Any]) -> tuple[PageSection, ...]:
    """Which effects were simulated and which not, and how finely."""
    effects = [(one["name"], bool(one["present"]), one["reason"]) for one in plan["effects"]]
    order, cells, why = plan["order"], plan["geometry_order"], plan.get("why_order")
    elements = f"Taylor-Hood elements P{order}-P{order - 1} on cells of order {cells}"
    rows: Rows = [
        ("elements", f"{elements}{f': {why}' if why else ''}"),
        ("cell sizes", f"{plan['mesh_size']:g} times the usual"),
        ("steps and convection", f"{plan['scheme']}, {plan['convection']}"),
        ("linear systems", f"{plan['solver']['name']}: {plan['solver']['reason']}"),
        ("Reynolds number", plan["reynolds"]),
    ]
    numbers = {name.replace("_", " "): value for name, value in (plan.get("numbers") or {}).items()}
    rows += [(name, value) for name, value in numbers.items() if value is not None]
    return section(
        "Plan: what was computed, and what was left out",
        table(("effect", "simulated", "why"), effects),
        words(plan.get("sought", ""), *(f"Warning: {one}." for one in plan.get("warnings", ()))),
        table(("how finely", ""), rows),
    )


def of_omissions(stored: list[dict[str, Any]]) -> tuple[PageSection, ...]:
    """What effects that were left out would have changed."""
    rows: Rows = []
    warnings = []
    for one in stored:
        omission = Omission(**one)
        size = "not known" if omission.relative is None else f"about {percent(omission.relative)}"
        rows.append((omission.name, size, omission.how))
        if omission.exceeds:
            may = f"{omission.name} may matter at the accuracy asked for"
            warnings.append(f"Warning: {may}: {omission.remedy}.")
    head = ("left out", "change of the result", "how that is known")
    return section("What leaving effects out changes", words(*warnings), table(head, rows))


def of_adaptation(stored: dict[str, Any] | None) -> tuple[PageSection, ...]:
    """The accuracy that was asked for, and the meshes tried for it."""
    if stored is None:
        return ()
    reached = "unknown" if stored["reached"] is None else f"{stored['reached']:.1e}"
    said = (
        f"Error of the {stored['of']}: {reached}; asked for {stored['asked']}: {stored['reason']}."
    )
    rows: Rows = [(f"P{one['order']}", *(one[key] for key in TRIED)) for one in stored["trials"]]
    head = ("order", "cells", "unknowns", "error", "step", "seconds", "")
    more = (*stored.get("changes", ()), *stored.get("beside", ()))
    return section("Meshes tried for the accuracy", words(said, *more), table(head, rows))


def of_cost(cost: dict[str, Any]) -> tuple[PageSection, ...]:
    """Time and memory by effect, the dearest first."""
    effects = cost.get("effects", {})
    total = sum(share["wall_time"] for share in effects.values()) or 1.0
    rows: Rows = []
    for name, share in sorted(effects.items(), key=lambda item: -item[1]["wall_time"]):
        part = f"{100 * share['wall_time'] / total:.1f} %"
        rows.append((name, share["wall_time"], part, share["memory_mib"], share["unknowns"]))
    whole: Rows = [
        ("wall time [s]", cost["wall_time"]["total"]),
        ("largest memory [MiB]", cost.get("peak_memory_mib")),
        ("unknowns", cost.get("unknowns")),
        ("cells", cost.get("cells")),
        ("ranks", cost.get("ranks", 1)),
        *((f"iterations: {name}", number) for name, number in cost.get("iterations", {}).items()),
    ]
    head = ("effect", "wall time [s]", "share", "memory [MiB]", "unknowns")
    return section("Cost by effect", table(head, rows), table(("in all", ""), whole))


def versions(cost: dict[str, Any]) -> str:
    """The versions of the programs behind a result."""
    return ", ".join(f"{name} {number}" for name, number in cost.get("versions", {}).items())
