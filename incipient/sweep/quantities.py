"""What a case has for the table: the keys that are varied, and the quantities that came out, with their error bars."""

from __future__ import annotations

import json
import math
import sqlite3
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from ..effects import known
from ..results.quantity import HIGH, LOW, at
from ..results.si import FLOW

_THRESHOLD = ("factor", "shields", "reynolds", "shear_reynolds")


def found(stored: Mapping[str, Any] | sqlite3.Row, keys: Sequence[str]) -> dict[str, Any]:
    """Varied keys and quantities of a case as the file has it, by name; what it does not have is missing.

    Raises ValueError, LookupError, TypeError or AttributeError: the case is damaged.
    """
    scene = scene_of(stored)
    row = {key: _shown(value) for key in keys if (value := at(scene, key)) is not None}
    if stored["result"]:
        row |= quantities(stored["task"], json.loads(stored["result"]))
    return row


def scene_of(stored: Mapping[str, Any] | sqlite3.Row) -> dict[str, Any]:
    """The scene of a case as plain data; raises ValueError, TypeError, AttributeError or RecursionError: damaged."""
    scene = (json.loads if stored["task"] == "judge" else tomllib.loads)(stored["scene"])
    if not isinstance(scene, dict):
        raise TypeError("a scene is a table of keys")
    return scene


def _shown(value: Any) -> Any:
    return value if isinstance(value, str | int | float | bool) else json.dumps(value)


def quantities(task: str, result: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers and words of the result of a case, error bars under NAME_low and NAME_high."""
    found = _OF_TASK.get(task, _of_verdict)(result)
    si = result.get("si") or {}
    return found | {f"{name}_si": si[name] for name in FLOW if name in si}


def _of_threshold(result: Mapping[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = {"mode": result["mode"]}
    for name in _THRESHOLD:
        value, error = result[name], result["errors"][name]
        found[name] = math.inf if value is None else value
        if value is not None and error is not None:
            found |= {name + LOW: value - error, name + HIGH: value + error}
    if "shields_nominal" in result:  # files of before do not have it
        value = result["shields_nominal"]
        found["shields_nominal"] = math.inf if value is None else value
    if result["reason"]:
        found["note"] = result["reason"]
    return found | _of_walls(result)


def _of_walls(result: Mapping[str, Any]) -> dict[str, Any]:
    """Whether walls were as a model of the mean flow asks; nothing without one, and of files of before."""
    applicable = result.get("applicable")
    return {} if applicable is None else {"applicable": applicable}


def _of_gust(result: Mapping[str, Any]) -> dict[str, Any]:
    found = {name: result[name] for name in ("strength", "held", "leaves", "impulse", "runs")}
    value, error = result["strength"], result["error"]
    ends = (
        {} if error is None else {"strength" + LOW: value - error, "strength" + HIGH: value + error}
    )
    return found | ends


def _of_entrainment(result: Mapping[str, Any]) -> dict[str, Any]:
    steady, own = result["threshold"], result["scene"]
    found: dict[str, Any] = {"mode": steady["mode"], "shields": steady["shields"]}
    found |= {
        "probability": own["probability"],
        f"probability{LOW}": own["low"],
        f"probability{HIGH}": own["high"],
    }
    found |= {} if own["rate"] is None else {"rate": own["rate"]}
    for one in result["quantiles"]:
        name = f"shields_at_{one['probability']:g}"
        found[name] = one["shields"]
        if one["error"] is not None:
            found |= {
                name + LOW: one["shields"] - one["error"],
                name + HIGH: one["shields"] + one["error"],
            }
    return found | _of_walls(steady)


def _of_verdict(result: Mapping[str, Any]) -> dict[str, Any]:
    verdict = result["verdict"]
    found: dict[str, Any] = {}
    if verdict is not None:
        factor = verdict["safety_factor"]
        found = {"mode": verdict["mode"], "moves": verdict["moves"]}
        found["safety_factor"] = math.inf if factor is None else factor
        paper = verdict["judges"]["criteria"]
        found["paper"] = paper["wording"] if paper["moves"] else "no incipient motion"
    numbers = (result.get("plan") or {}).get("numbers") or {}
    if numbers.get("shields") is not None:
        found["flow_shields"] = numbers["shields"]  # `shields` is critical
    bars = result.get("error_bars")
    if bars is not None and bars["safety_factor"] is not None:
        bar = bars["safety_factor"]
        ends = (math.inf if bar[end] is None else bar[end] for end in ("low", "high"))
        found |= dict(zip((f"safety_factor{LOW}", f"safety_factor{HIGH}"), ends, strict=True))
        found["certain"] = bar["certain"]
    for quantity in known.quantities():
        found |= quantity.columns(result)
    return found


_OF_TASK = {"threshold": _of_threshold, "gust": _of_gust, "entrainment": _of_entrainment}
