"""DFG 2D-2 and 2D-3: amplitudes, frequency and times of the forces on a cylinder in a time-dependent flow."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import callers
import figures
import numpy as np
from measure import Session
from references import PULSATING, VORTEX_STREET
from tables import Row, failures, read_rows, seconds, table

from incipient.output.series_file import read_step

DIAMETER, MEAN_VELOCITY = 0.1, 1.0
FRONT, BACK = (0.15, 0.2), (0.25, 0.2)  # of the cylinder: nodes of the mesh
LATE = 2.0  # the last so much time is taken for periodic
REFINED = (
    {"numerics.mesh_size": 1.0},
    {"numerics.mesh_size": 1.0, "numerics.order": 4, "time.step": 0.0025},
)
NAMES = {"drag": "C_D,max", "lift": "C_L,max", "strouhal": "St"}
# Order, cells at the cylinder and far away, step: explicit convection allows no longer ones.
EXPLICIT = ((3, 0.015, 0.06, 0.0005), (4, 0.015, 0.06, 0.0004))
# What cells and steps of the program's own go to.
LIMIT = {"drag": 3.227, "lift": 0.987, "strouhal": 0.301}


def _read(directory: Path) -> Row:
    """The numbers of a run, with the history of the forces."""
    rows = read_rows(directory / "history.csv")
    history = {name: [row[name] for row in rows] for name in ("time", "drag", "lift")}
    return {**callers.read_result(directory), "history": history}


def _read_with_pressure(directory: Path) -> Row:
    """The same with the pressure difference across the cylinder at the end."""
    step = read_step(directory / "fields")
    front, back = (
        np.flatnonzero(np.linalg.norm(step.points[:, :2] - place, axis=1) < 1e-6)[0]
        for place in (FRONT, BACK)
    )
    pressure = np.ravel(step.fields["pressure"])
    return {**_read(directory), "pressure": float(pressure[front] - pressure[back])}


def measure(session: Session) -> dict[str, Any]:
    """Both flows and the other programs, each run once: they take long."""
    periodic = _march(session, "vortex_street", {})
    if "error" not in periodic:
        figures.vortex_street(periodic["history"])
    refined = [_march(session, "vortex_street", settings) for settings in REFINED]
    # As a user who knows the library would write it; forces of the last time only.
    others = [
        session.once(
            callers.ngsolve(
                "ngsolve_vortex_street",
                f"P{order}-P{order - 1}, cells {near:g} to {far:g}, step {step:g}, explicit convection",
                *(order, near, far, step, 7.0, 7.0 - LATE),
            )
        )
        for order, near, far, step in EXPLICIT
        if callers.ngsolve_version()
    ]
    return {
        "periodic": _with_amplitudes(periodic),
        "refined": [_with_amplitudes(row) for row in refined],
        "others": [_with_amplitudes(row) for row in others],
        "pulsating": _with_maxima(_march(session, "pulsating", {}, _read_with_pressure)),
    }


def _march(
    session: Session,
    scene: str,
    settings: dict[str, Any],
    read: Callable[[Path], Row] = _read,
) -> Row:
    """One row, after a few steps that see to compiled forms."""
    session.once(callers.incipient(session, scene, "warm-up", {**settings, "time.end": 0.05}))
    name = ", ".join(f"{key.split('.')[1]} = {value}" for key, value in settings.items())
    name = name or "the scene as it is"
    return session.once(callers.incipient(session, scene, name, settings, read=read))


def _peaks(history: dict[str, list[float]], name: str, since: float) -> np.ndarray:
    """Times and values (n, 2) of maxima later than `since`, by parabolas through the three samples around."""
    times, values = np.array(history["time"]), np.array(history[name])
    is_top = (values[:-2] <= values[1:-1]) & (values[1:-1] > values[2:]) & (times[1:-1] > since)
    peaks = []
    for first in np.flatnonzero(is_top).tolist():
        around = slice(first, first + 3)
        parabola = np.polynomial.Polynomial.fit(times[around], values[around], 2)
        (top,) = parabola.deriv().roots()
        peaks.append((float(top), float(parabola(top))))
    return np.array(peaks)


def _with_amplitudes(row: Row) -> Row:
    """A row with the numbers of the benchmark, from the last of the time."""
    if "error" in row:
        return row
    history = row.pop("history")
    drags, lifts = (_peaks(history, name, history["time"][-1] - LATE) for name in ("drag", "lift"))
    period = float(np.diff(lifts[:, 0]).mean())
    numbers = {
        "drag": float(drags[:, 1].max()),
        "lift": float(lifts[:, 1].max()),
        "strouhal": DIAMETER / MEAN_VELOCITY / period,
    }
    # How periodic it is: the change of the lift's amplitude over the last periods.
    growth = float(lifts[-1, 1] - lifts[0, 1])
    return {**row, "found": numbers, "growth": growth, "periods": len(lifts)}


def _with_maxima(row: Row) -> Row:
    """A row with the numbers of the benchmark, from all of the time."""
    if "error" in row:
        return row
    history, numbers = row.pop("history"), {"pressure": row["pressure"]}
    for name in ("drag", "lift"):
        peaks = _peaks(history, name, 0.0)
        numbers[f"{name} at"], numbers[name] = peaks[peaks[:, 1].argmax()].tolist()
    return {**row, "found": numbers}


def describe(data: dict[str, Any]) -> str:
    """The section of the page."""
    return f"""### Vortex street, Re = 100 (DFG 2D-2)

{_describe_periodic(data["periodic"], data["refined"], data["others"])}

### Pulsating flow around a cylinder (DFG 2D-3)

{_describe_pulsating(data["pulsating"])}"""


def _describe_periodic(row: Row, refined: list[Row], others: list[Row]) -> str:
    if "error" in row:
        return f"Could not be run: `{row['error']}`."
    published = [
        "Schäfer & Turek (1996)",
        *(f"{low:g} to {high:g}" for low, high in VORTEX_STREET.values()),
        "",
    ]
    cells = [
        [
            f"{r['family']}: {r['name']}",
            *(f"{r['found'][key]:.4f}" for key in NAMES),
            seconds(r["cpu"]),
        ]
        for r in (row, *refined, *others)
        if "error" not in r
    ]
    limits = ", ".join(f"{NAMES[key]} = {value:g}" for key, value in LIMIT.items())
    return f"""![Drag and lift of the cylinder](../figures/vortex_street.png)

`demos/scenes/vortex_street.toml`, from rest; maxima over the last {row["periods"]} periods of the lift ({LATE:g} time
units).

{table(["", *NAMES.values(), "CPU [s]"], [published, *cells])}

*Explicit convection* is of first order in time and
factorises once. Limit of incipient's cells and steps: {limits}.

{failures([row, *others])}"""


def _describe_pulsating(row: Row) -> str:
    if "error" in row:
        return f"Could not be run: `{row['error']}`."
    names = {
        "drag": "C_D,max",
        "drag at": "its time",
        "lift": "C_L,max",
        "lift at": "its time",
        "pressure": "pressure difference at t = 8",
    }
    values = [
        f"{names[key]} {row['found'][key]:.5f} ({value:.5f})" for key, value in PULSATING.items()
    ]
    iterations = row["iterations"]
    each = 1000 * row["cpu"] / iterations["steps"]
    return f"""`demos/scenes/pulsating.toml`: inflow as sin(pi t/8), 0 <= t <= 8. In brackets John (2004):
{", ".join(values)}.
{row["unknowns"]} unknowns, {iterations["steps"]} steps, {iterations["newton"]} Newton updates, \
{iterations["factorisations"]} factorisations: {seconds(row["cpu"])} s ({each:.0f} ms a step), \
{row["peak_mib"]:.0f} MiB."""
