"""The memory that the plan announces against the peak that is measured, and the law's two constants fitted."""

from __future__ import annotations

import json
from math import log2
from typing import Any

import callers
from measure import Program, Session
from tables import Row

ERROR_BARS, ERRORS = "numerics.error_bars", "with error bars"
CASES = (
    ("cylinder", {"numerics.order": 2}),
    ("cylinder", {"numerics.order": 2, "numerics.mesh_size": 0.35}),
    ("cylinder", {"numerics.order": 2, "numerics.mesh_size": 0.2}),
    ("cylinder", {"numerics.order": 3, "numerics.mesh_size": 0.35}),
    ("cylinder", {"numerics.order": 4}),
    ("cylinder", {"numerics.order": 4, "numerics.mesh_size": 0.25}),
    ("cavity", {"numerics.order": 2, "numerics.mesh_size": 0.4}),
    ("cavity", {"numerics.order": 4}),
    ("cavity", {"numerics.order": 4, "numerics.mesh_size": 0.5, "fluid.reynolds": 4000}),
    ("grain_on_bed", {}),
    ("grain_on_bed", {"numerics.mesh_size": 0.25}),
    ("grain_on_bed", {"numerics.order": 4, "numerics.mesh_size": 0.25}),
    ("cylinder", {"numerics.order": 2, "numerics.mesh_size": 0.35, ERROR_BARS: True}),
    ("cylinder", {"numerics.order": 4, ERROR_BARS: True}),
    ("grain_on_bed", {ERROR_BARS: True}),
    ("grain_on_bed", {"numerics.mesh_size": 0.25, ERROR_BARS: True}),
)


def measure(session: Session) -> dict[str, Any]:
    """Peaks and announcements, and the base and factor that would fit best."""
    rows = []
    for scene, settings in CASES:
        row = session.once(callers.incipient(session, scene, _name(scene, settings), settings))
        if "error" not in row:
            announced = session.once(_plan(scene, settings))
            rows.append({**_kept(row), "announced": announced["estimate"]["memory_mib"]})
    alone = [row for row in rows if ERRORS not in row["name"]]
    base, factor = fit([(row["unknowns"], row["peak_mib"]) for row in alone])
    session.say(f"memory law: base {base:.0f} MiB, {factor:.0f} bytes per n log2 n")
    return {"rows": rows, "fit": {"base_mib": base, "bytes": factor}}


def _name(scene: str, settings: dict[str, Any]) -> str:
    parts = [
        f"{key.split('.')[1]} = {value:g}" for key, value in settings.items() if key != ERROR_BARS
    ]
    return ", ".join([scene, *parts, *([ERRORS] if ERROR_BARS in settings else [])])


def _plan(scene: str, settings: dict[str, Any]) -> Program:
    own, settings = callers.command("incipient"), {ERROR_BARS: False, **settings}
    options = [
        part for key, value in settings.items() for part in ("--set", f"{key}={json.dumps(value)}")
    ]
    command = (own, "plan", f"demos/scenes/{scene}.toml", "--json", *options)
    return Program("plan", callers.INCIPIENT, command, lambda usage: json.loads(usage.output))


def _kept(row: Row) -> Row:
    return {key: row[key] for key in ("name", "unknowns", "cells", "peak_mib")}


def fit(points: list[tuple[int, float]]) -> tuple[float, float]:
    """Base [MiB] and factor [bytes] of peak = base + factor n log2 n, by least squares of relative errors."""
    # Each line of base + factor s = peak, divided by its peak.
    lines = [(1 / peak, n * log2(n) / 2**20 / peak) for n, peak in points]
    aa, ab, bb = (sum(x * y for x, y in pairs) for pairs in _products(lines))
    a, b = (sum(line[i] for line in lines) for i in (0, 1))
    determinant = aa * bb - ab * ab
    return (a * bb - b * ab) / determinant, (aa * b - ab * a) / determinant


def _products(lines: list[tuple[float, float]]) -> list[list[tuple[float, float]]]:
    return [[(line[i], line[j]) for line in lines] for i, j in ((0, 0), (0, 1), (1, 1))]


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    off = [100 * (r["announced"] / r["peak_mib"] - 1) for r in data["rows"]]
    sizes = [r["unknowns"] for r in data["rows"]]
    found = data["fit"]
    return f"""### Memory predicted and used

In {len(sizes)} runs of `cylinder`, `cavity` and `grain_on_bed` ({min(sizes)} to {max(sizes)} unknowns, orders 2 to 4)
`incipient plan` is {min(off):+.0f}% to {max(off):+.0f}% off the measured peak. Best fit for n unknowns:
{found["base_mib"]:.0f} MiB + {found["bytes"]:.0f} bytes n log2 n."""
