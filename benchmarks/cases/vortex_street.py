"""DFG 2D-2 and 2D-3: amplitudes, frequency and times of the forces on a cylinder in a time-dependent flow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import callers
import history
from measure import Program, Session
from references import PULSATING, VORTEX_STREET
from tables import Row, failures, seconds, table

DIAMETER, MEAN_VELOCITY = 0.1, 1.0
LATE = 2.0  # the last so much time is taken for periodic
FIGURE = "docs/figures/vortex_street.png"
REFINED = (
    {"numerics.mesh_size": 1.0},
    {"numerics.mesh_size": 1.0, "numerics.order": 4, "time.step": 0.0025},
)
NAMES = {"drag": "C_D,max", "lift": "C_L,max", "strouhal": "St"}
# Order, cells at the cylinder and far away, step: explicit convection allows no longer ones.
EXPLICIT = ((3, 0.015, 0.06, 0.0005), (4, 0.015, 0.06, 0.0004))
# What cells and steps of the program's own go to.
LIMIT = {"drag": 3.227, "lift": 0.987, "strouhal": 0.301}


def measure(session: Session) -> dict[str, Any]:
    """Both flows and the other programs, each run once: they take long."""
    periodic = _periodic(session, {})
    if "error" not in periodic:
        file = Path(periodic["directory"]) / "history.csv"
        drawn = session.once(
            callers.script("figure", "benchmarks/figures.py", "vortex_street", file, FIGURE)
        )
        session.say(drawn.get("error", f"drew {FIGURE}"))
    refined = [_periodic(session, settings) for settings in REFINED]
    others = [_other(session, program) for program in _others(session)]
    return {
        "periodic": periodic,
        "refined": refined,
        "others": others,
        "pulsating": _pulsating(session),
    }


def _others(session: Session) -> Iterator[Program]:
    """Other programs, as a user who knows the library would write them; forces of the last time only."""
    end, late = "7", str(7 - LATE)
    if callers.prepare_ngsolve(session):
        for order, near, far, step in EXPLICIT:
            name = f"P{order}-P{order - 1}, cells {near:g} to {far:g}, step {step:g}, explicit convection"
            yield callers.ngsolve("ngsolve_vortex_street", name, order, near, far, step, end, late)


def _other(session: Session, program: Program) -> Row:
    row = session.once(program)
    session.say(
        f"{program.family}, {program.name}: {row.get('error') or seconds(row['wall']) + ' s'}"
    )
    if "error" in row:
        return row
    times, drag, lift = (row.pop(key) for key in ("time", "drag", "lift"))
    return {**row, "found": _found(times, drag, lift)}


def _march(session: Session, scene: str, settings: dict[str, Any]) -> Row:
    """One row, after a few steps that see to compiled forms."""
    session.once(callers.incipient(session, scene, "warm-up", {**settings, "time.end": 0.05}))
    name = (
        ", ".join(f"{key.split('.')[1]} = {value}" for key, value in settings.items())
        or "the scene as it is"
    )
    row = session.once(callers.incipient(session, scene, name, settings))
    session.say(f"{scene}, {name}: {row.get('error') or seconds(row['wall']) + ' s'}")
    return row


def _periodic(session: Session, settings: dict[str, Any]) -> Row:
    row = _march(session, "vortex_street", settings)
    if "error" in row:
        return row
    times, drag, lift = history.columns(
        Path(row["directory"]) / "history.csv", "time", "drag", "lift"
    )
    found = _found(times, drag, lift)
    lifts = history.peaks(times, lift, times[-1] - LATE)
    # How periodic it is: the change of the lift's amplitude over the last periods.
    return {
        **row,
        "found": found,
        "growth": lifts[-1].value - lifts[0].value,
        "periods": len(lifts),
    }


def _found(
    times: Sequence[float], drag: Sequence[float], lift: Sequence[float]
) -> dict[str, float]:
    """The numbers of the benchmark, from the last of the time."""
    lifts, drags = (history.peaks(times, values, times[-1] - LATE) for values in (lift, drag))
    return {
        "drag": max(peak.value for peak in drags),
        "lift": max(peak.value for peak in lifts),
        "strouhal": DIAMETER / MEAN_VELOCITY * history.frequency(lifts),
    }


def _pulsating(session: Session) -> Row:
    row = _march(session, "pulsating", {})
    if "error" in row:
        return row
    times, drag, lift = history.columns(
        Path(row["directory"]) / "history.csv", "time", "drag", "lift"
    )
    highest = {
        name: history.highest(times, values) for name, values in (("drag", drag), ("lift", lift))
    }
    found: dict[str, float] = {}
    for name, peak in highest.items():
        found |= {name: asdict(peak)["value"], f"{name} at": peak.time}
    pressure = session.once(callers.script("pressure", "benchmarks/pressure.py", row["directory"]))
    return {**row, "found": {**found, "pressure": pressure.get("pressure")}}


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


def worst(row: Row) -> float:
    """The largest relative error of the three numbers."""
    return max(abs(row["found"][key] / value - 1) for key, value in LIMIT.items())


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
        f"{names[key]} {row['found'][key]:.5f} ({value:.5f})"
        for key, value in PULSATING.items()
        if row["found"].get(key) is not None
    ]
    return f"""`demos/scenes/pulsating.toml`: inflow as sin(pi t/8), 0 <= t <= 8. In brackets John (2004):
{", ".join(values)}.
{_cost(row)}"""


def _cost(row: Row) -> str:
    steps = row["iterations"]["steps"]
    each = 1000 * row["cpu"] / steps
    iterations = row["iterations"]
    return (
        f"{row['unknowns']} unknowns, {steps} steps, {iterations['newton']} Newton updates, "
        f"{iterations['factorisations']} factorisations: {seconds(row['cpu'])} s ({each:.0f} ms a step), "
        f"{row['peak_mib']:.0f} MiB."
    )
