"""The part of docs/validation/performance.md that is written from results.json."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import callers
import cases
from cases import races
from references import VORTEX_STREET
from tables import cheapest, publish

HEAD = "**Machine.** {processor}, {cores} cores, {memory_gib} GiB, {system}; {versions}."


def write(results: dict[str, Any]) -> None:
    """Write the part of the page that is measured."""
    measured = results["cases"]
    versions = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    sections = [
        HEAD.format(versions=versions, **results["machine"]),
        *(case.describe(measured[name]) for name, case in cases.ALL.items() if name in measured),
        "### Shortcomings\n\n"
        + ("\n".join(f"- {item}" for item in _shortcomings(measured)) or "- None known."),
    ]
    publish("performance", "\n\n".join(section.strip() for section in sections))


def _shortcomings(measured: dict[str, Any]) -> Iterator[str]:
    for name, race in races.ALL.items():
        best = cheapest(measured.get(name, {}).get("rows", []), race.reaches)
        ours = best.get(callers.INCIPIENT)
        for family, row in best.items():
            if ours and row["wall"] < ours["wall"]:
                ratio = ours["wall"] / row["wall"]
                yield (
                    f"{race.work}: {family} reaches the accuracy sooner; "
                    f"incipient takes {ratio:.2f} times as long."
                )
    street = measured.get("vortex_street", {}).get("periodic", {})
    for name, value in street.get("found", {}).items():
        low, high = VORTEX_STREET[name]
        if not low <= value <= high:
            yield f"DFG 2D-2: {name} {value:.4f} lies outside the published {low:g} to {high:g}."
    for row in measured.get("memory", {}).get("rows", []):
        error = row["announced"] / row["peak_mib"] - 1
        if abs(error) > 0.25:
            yield f"Memory announced for {row['name']} is off by {100 * error:+.0f}%."
