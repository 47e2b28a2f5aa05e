"""The memory that the plan announces against the peak that is measured, and the law's two constants fitted."""

from __future__ import annotations

import json
from typing import Any

import callers
import numpy as np
from measure import Session
from measure import measure as measured

ERROR_BARS, ERRORS = "numerics.error_bars", "with error bars"
CASES: tuple[tuple[str, dict[str, Any]], ...] = (
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
            keys = {ERROR_BARS: False, **settings}
            plan = measured(callers.command("plan", f"demos/scenes/{scene}.toml", keys, "--json"))
            announced = json.loads(plan.output)["estimate"]["memory_mib"]
            numbers = {key: row[key] for key in ("name", "unknowns", "cells", "peak_mib")}
            rows.append({**numbers, "announced": announced})
    # Least squares of relative errors: each line of base + factor n log2 n = peak is divided by its peak.
    alone = [(row["unknowns"], row["peak_mib"]) for row in rows if ERRORS not in row["name"]]
    unknowns, peaks = np.array(alone).T
    lines = np.column_stack([1.0 / peaks, unknowns * np.log2(unknowns) / 2**20 / peaks])
    base, factor = np.linalg.lstsq(lines, np.ones(len(lines)), rcond=None)[0].tolist()
    return {"rows": rows, "fit": {"base_mib": base, "bytes": factor}}


def _name(scene: str, settings: dict[str, Any]) -> str:
    parts = [
        f"{key.split('.')[1]} = {value:g}" for key, value in settings.items() if key != ERROR_BARS
    ]
    return ", ".join([scene, *parts, *([ERRORS] if ERROR_BARS in settings else [])])


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    off = [100 * (r["announced"] / r["peak_mib"] - 1) for r in data["rows"]]
    sizes = [r["unknowns"] for r in data["rows"]]
    law = data["fit"]
    return f"""### Memory predicted and used

In {len(sizes)} runs of `cylinder`, `cavity` and `grain_on_bed` ({min(sizes)} to {max(sizes)} unknowns, orders 2 to 4)
`incipient plan` is {min(off):+.0f}% to {max(off):+.0f}% off the measured peak. Best fit for n unknowns:
{law["base_mib"]:.0f} MiB + {law["bytes"]:.0f} bytes n log2 n."""
