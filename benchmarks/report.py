"""The part of docs/validation/performance.md that is written from results.json."""

from __future__ import annotations

from typing import Any

import cases
import goals
from tables import publish

HEAD = "**Machine.** {processor}, {cores} cores, {memory_gib} GiB, {system}; {versions}."


def write(results: dict[str, Any]) -> None:
    """Write the part of the page that is measured."""
    measured = results["cases"]
    parts = [_head(results), "### Goals\n\n" + goals.summary(measured)]
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
    items = goals.shortcomings(measured) or ["Nothing else."]
    return "### Shortcomings beside missed goals\n\n" + "\n".join(f"- {item}" for item in items)
