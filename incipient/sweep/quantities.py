"""The quantities of a case's result for the table of a sweep, with their error bars."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ..effects import known
from ..results.quantity import HIGH, LOW
from ..results.si import FLOW

Result = Mapping[str, Any]


def quantities(task: str, result: Result) -> dict[str, Any]:
    """Numbers and words of the result of a case, error bars under NAME_low and NAME_high."""
    columns = _OF_TASK.get(task, _of_verdict)(result)
    si = result.get("si") or {}
    return columns | {f"{name}_si": si[name] for name in FLOW if name in si}


def _with_bar(name: str, value: float | None, error: float | None) -> dict[str, float]:
    """A quantity, infinite where no flow reaches it, and the ends of its bar where there is one."""
    if value is None or error is None:
        return {name: math.inf if value is None else value}
    return {name: value, name + LOW: value - error, name + HIGH: value + error}


def _of_threshold(result: Result) -> dict[str, Any]:
    columns: dict[str, Any] = {"mode": result["mode"]}
    for name in ("factor", "shields", "reynolds", "shear_reynolds"):
        columns |= _with_bar(name, result[name], result["errors"][name])
    columns |= _with_bar("shields_nominal", result["shields_nominal"], None)
    if result["reason"]:
        columns["note"] = result["reason"]
    return columns


def _of_gust(result: Result) -> dict[str, Any]:
    columns = {name: result[name] for name in ("strength", "held", "leaves", "impulse", "runs")}
    return columns | _with_bar("strength", result["strength"], result["error"])


def _of_entrainment(result: Result) -> dict[str, Any]:
    steady, own = result["threshold"], result["scene"]
    columns: dict[str, Any] = {"mode": steady["mode"], "shields": steady["shields"]}
    columns |= {"probability": own["probability"]}
    columns |= {f"probability{LOW}": own["low"], f"probability{HIGH}": own["high"]}
    columns |= {} if own["rate"] is None else {"rate": own["rate"]}
    for quantile in result["quantiles"]:
        name = f"shields_at_{quantile['probability']:g}"
        columns |= _with_bar(name, quantile["shields"], quantile["error"])
    return columns


def _of_verdict(result: Result) -> dict[str, Any]:
    verdict, columns = result["verdict"], dict[str, Any]()
    if verdict is not None:
        columns = {"mode": verdict["mode"], "moves": verdict["moves"]}
        columns |= _with_bar("safety_factor", verdict["safety_factor"], None)
        paper = verdict["judges"]["criteria"]
        columns["paper"] = paper["wording"] if paper["moves"] else "no incipient motion"
    numbers = (result.get("plan") or {}).get("numbers") or {}
    if numbers.get("shields") is not None:
        columns["flow_shields"] = numbers["shields"]  # `shields` is critical
    bar = (result.get("error_bars") or {}).get("safety_factor")
    if bar is not None:
        for name, end in ((LOW, "low"), (HIGH, "high")):
            columns |= _with_bar(f"safety_factor{name}", bar[end], None)
        columns["certain"] = bar["certain"]
    for quantity in known.quantities():
        columns |= quantity.columns(result)
    return columns


_OF_TASK = {"threshold": _of_threshold, "gust": _of_gust, "entrainment": _of_entrainment}
