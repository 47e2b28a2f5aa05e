"""The part of docs/validation/performance.md that is written from results.json."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import callers
import cases
from cases import cavity, cylinder
from references import VORTEX_STREET
from tables import cheapest, publish

HEAD = "**Machine.** {processor}, {cores} cores, {memory_gib} GiB, {system}; {versions}."


def write(results: dict[str, Any]) -> None:
    """Write the part of the page that is measured."""
    measured = results["cases"]
    parts = [_head(results)]
    parts += [
        case.describe(measured[name]).strip()
        for name, case in cases.ALL.items()
        if name in measured
    ]
    parts.append(_shortcomings(measured))
    publish("performance", "\n\n".join(part.strip() for part in parts))


def _head(results: dict[str, Any]) -> str:
    versions = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    return HEAD.format(versions=versions, **results["machine"])


def _shortcomings(measured: dict[str, Any]) -> str:
    items = [*_slower(measured), *_outside(measured), *_memory(measured)] or ["None known."]
    return "### Shortcomings\n\n" + "\n".join(f"- {item}" for item in items)


def _slower(measured: dict[str, Any]) -> Iterator[str]:
    """Programs that reached the same accuracy in less time."""
    races = {
        "cylinder": ("DFG 2D-1", cylinder.reaches),
        "cavity": ("the cavity at Re = 1000", lambda row: cavity.worst(row) <= cavity.TARGET),
    }
    for name, (work, reaches) in races.items():
        best = cheapest(measured.get(name, {}).get("rows", []), reaches)
        ours = best.get(callers.INCIPIENT)
        for family, row in best.items():
            if ours and row["wall"] < ours["wall"]:
                ratio = ours["wall"] / row["wall"]
                yield f"{work}: {family} reaches the accuracy sooner; incipient takes {ratio:.2f} times as long."


def _outside(measured: dict[str, Any]) -> Iterator[str]:
    street = measured.get("vortex_street", {}).get("periodic", {})
    for name, (low, high) in VORTEX_STREET.items():
        value = street.get("found", {}).get(name)
        if value is not None and not low <= value <= high:
            yield f"DFG 2D-2: {name} {value:.4f} lies outside the published {low:g} to {high:g}."


def _memory(measured: dict[str, Any]) -> Iterator[str]:
    for row in measured.get("memory", {}).get("rows", []):
        off = row["announced"] / row["peak_mib"] - 1
        if abs(off) > 0.25:
            yield f"Memory announced for {row['name']} is off by {100 * off:+.0f}%."
