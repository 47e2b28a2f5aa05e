"""Scene files at random, around valid ones: wrong types, extremes, sections of other scenes, broken text."""

from __future__ import annotations

import copy
import math
import os
import signal
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import tomli_w
from kinds import BEDS, FLOWS, GRAINS, SOLIDS, TERRAINS, resting
from pydantic_core import to_json
from scenes import SCENES

from incipient.errors import IncipientError
from incipient.scene import Scene, loads
from incipient.scene.section import is_number
from incipient.setup.setup import Setup

HANGING = (
    60  # seconds of processor time after which a scene counts as hanging, on a busy machine as well
)
NOWHERE = Path(os.devnull).parent  # a directory without scenes

FACTORS = (
    0.0,
    -1.0,
    1e-300,
    1e-30,
    1e-12,
    1e-6,
    1e-3,
    0.1,
    0.5,
    2.0,
    10.0,
    1e3,
    1e6,
    1e12,
    1e30,
    1e300,
)
# What makes another problem of a scene.
SECTIONS: dict[str, list[dict[str, Any]]] = {
    "units": [{"diameter": 1e-3, "shear_rate": 1.0}, {"diameter": 1e-3, "velocity": 0.1}],
    "domain": [{"top": top} for top in ("slip", "wall", "stream", "free-surface")]
    + [{"kind": "box"}],
    "time": [{"end": 1.0, "step": 0.5}, {"end": 1.0, "step": 1e-9}],
    "effects": [{"turbulence": True}, {"inertia": False}],
    "turbulence": [{"model": "k-omega-sst"}, {"model": "k-epsilon", "roughness": 0.1}],
    "body": [
        {"motion": "free"},
        {"course": ["sin(t)", "0", "t"]},
        {"settle": True},
        *GRAINS,
        *SOLIDS,
    ],
    "bed": [*BEDS, *TERRAINS],
    "numerics": [{"accuracy": 0.01}, {"accuracy": "verdict"}, {"mesh_size": 1e-9}],
    "flow": [
        {"kind": "log-law"},
        {"kind": "lid"},
        {"gust": {"shape": "top-hat", "strength": 2.0, "duration": 0.1}},
        *FLOWS,
    ],
}
KEYS = ("kind", "x", "y", "tolerance", "\u00e9", "", "order", "accuracy")
NASTY: list[Any] = [
    *(
        0,
        0.0,
        -0.0,
        -1,
        1,
        1e300,
        -1e300,
        5e-324,
        math.nan,
        math.inf,
        -math.inf,
        10**40,
        10**400,
        -(2**63),
    ),
    *(
        True,
        False,
        "",
        " ",
        "auto",
        "on",
        "no",
        "disc",
        "flat",
        "\u00e9\u4e2d\U0001f642\u202e",
        "x" * 10_000,
        "../../etc",
        "/dev/null",
        "/dev/zero",
        "costs $5 and $6",
        "$\\frac{1}{$ [/coarse] {x} %s",
        "n" * 256 + ".csv",
    ),
    *(
        [],
        [[]],
        [0],
        [1.0, 2.0],
        [1, 2, 3],
        [math.nan, 1.0],
        ["a", "b"],
        [[0, 0], [1, 1]],
        [[0, 0]] * 3,
        [1e300, -1e300],
    ),
    *({}, {"kind": "disc"}, {"a": {"b": {"c": {}}}}),
]


def scene_text(random: Random) -> str:
    """A scene file, rarely without a mistake."""
    scene = _valid(random, random.random() < 0.15)
    for _ in range(random.choice((0, 1, 1, 1, 2, 2, 3))):
        scene = _changed(random, scene)
    return _spoilt(random, tomli_w.dumps(scene))


# Unusual numbers that are allowed, by section and key; a free surface without gravity is refused.
ODD = {
    ("body", "density"): (0.0, 0.5, 1.0, 2.65, 1e6),
    ("contact", "friction"): (0.0, 1e-9, 0.5, 1e9),
    ("contact", "gap"): (1e-4, 1e-3, 1e-2, 0.1),
    ("gravity", "acceleration"): (1e-3, 1.0, 1e12),
    ("fluid", "reynolds"): (1e-6, 1e-3, 0.1, 1.0, 30.0, 1e4),
    ("numerics", "mesh_size"): (2.0, 3.0, 5.0),
}


def odd_scene_text(random: Random) -> str:
    """A scene whose numbers are unusual but allowed, in any units, on coarse cells."""
    scene = _valid(random)
    scene["numerics"] = {"error_bars": False, "max_cells": 4000}
    scene["output"] = {"fields": False}
    if "time" in scene:
        scene["time"]["end"] = 2.0 * scene["time"]["step"]
    for (section, key), values in ODD.items():
        if section in scene:
            scene[section][key] = random.choice(values)
    return tomli_w.dumps(scene)


def _valid(random: Random, in_space: bool = False) -> dict[str, Any]:
    """A valid scene, or one that could be; files that it names are not there."""
    if in_space:
        return copy.deepcopy(resting(random.choice(SOLIDS), random.choice(TERRAINS)))
    if random.random() < 0.3:
        path = random.choice(sorted(SCENES.glob("*.toml")))
        return tomllib.loads(path.read_text(encoding="utf-8"))
    scene = copy.deepcopy(resting(random.choice(GRAINS), random.choice(BEDS)))
    del scene["numerics"]
    scene["fluid"] = {"reynolds": 20.0, "scale": random.choice(("grain", "flow"))}
    scene["flow"] = copy.deepcopy(random.choice(FLOWS))
    scene["body"] |= {"x": random.uniform(2.0, 6.0), "angle": random.uniform(-180.0, 180.0)}
    if random.random() < 0.3:
        scene["body"] |= {"centre": [scene["body"].pop("x"), 2.0]}
        del scene["bed"], scene["contact"]
    elif random.random() < 0.03:
        scene["body"]["settle"] = True
    if random.random() < 0.2:
        scene["time"] = {"end": 1.0, "step": 0.5}
    return scene


def _changed(random: Random, scene: dict[str, Any]) -> dict[str, Any]:
    """The scene with one thing changed."""
    scene = copy.deepcopy(scene)
    places = list(_places(scene))
    numbers = [place for place in places if is_number(place[0][place[1]])]
    holder, key = random.choice(places)
    match random.randrange(9):
        case 0 | 1:
            holder[key] = copy.deepcopy(random.choice(NASTY))
        case 2 | 3 | 4 if numbers:
            holder, key = random.choice(numbers)
            holder[key] = _times(holder[key], random.choice(FACTORS))
        case 5:
            del holder[key]
        case 6:
            section = scene.setdefault(random.choice(list(Scene.model_fields)), {})
            if isinstance(section, dict):
                section[random.choice(KEYS)] = random.choice(NASTY)
        case 7 | 8:
            name, sections = random.choice([*SECTIONS.items()])
            if isinstance(scene.get(name, {}), dict):
                scene[name] = {**scene.get(name, {}), **copy.deepcopy(random.choice(sections))}
    return scene


def _places(node: Any) -> Iterator[tuple[Any, Any]]:
    """Everything in the scene as what holds it and the key or index there."""
    items = (
        node.items()
        if isinstance(node, dict)
        else enumerate(node)
        if isinstance(node, list)
        else ()
    )
    for key, value in list(items):
        yield node, key
        yield from _places(value)


def _times(number: float, factor: float) -> float:
    """The product, infinite where whole numbers are too large for it."""
    return number * factor if abs(number) < 1e300 else math.inf


def _spoilt(random: Random, text: str) -> str:
    """The text, rarely with something in it that is no TOML."""
    if random.random() < 0.9:
        return text
    at = random.randrange(len(text))
    junk = (
        "[" * 3000,
        "9" * 5000,
        "\0",
        "\u202e",
        "'''",
        '"',
        "=",
        "\n[domain]\n",
        "a.b.c = 1\n",
        "{",
        "\ud7ff",
    )
    return random.choice((text[:at], text[:at] + random.choice(junk) + text[at:]))


@contextmanager
def limited(seconds: int = HANGING) -> Iterator[None]:
    """Raise TimeoutError in the block where it takes more processor time."""

    def stop(number: int, frame: object) -> None:
        raise TimeoutError(f"hangs for more than {seconds} s")

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def fate(text: str, directory: Path, mesh: bool, run: bool = False) -> str:
    """What becomes of a scene file: "refused", "planned", "meshed" or "run"; anything but one line is an error.

    Raises whatever the program raises that is not meant for users, and TimeoutError.
    """
    import incipient
    from incipient.accuracy.first_mesh import first_mesh
    from incipient.planning.meshing import lay_out
    from incipient.planning.plan import make_plan

    reached = "refused"
    try:
        with limited():
            scene = loads(text, directory)
            reached = "planned"
            plan = make_plan(scene)
            assert "nan" not in plan.text().split()
            if run:
                _check(incipient.run(scene).to_dict())
                return "run"
            if mesh:
                first_mesh(scene)
                return "meshed"
            lay_out(Setup(scene), plan)
    except IncipientError as error:
        said = str(error)
        assert said and "\n" not in said and len(said) < 1000 and "Error(" not in said, said
        return f"{reached}, then refused" if reached != "refused" else reached
    return reached


def _check(result: dict[str, Any]) -> None:
    """A result has finite loads on its grain, and nothing in it is not a number."""
    if result["scene"]["body"] is not None and result["status"] == "complete":
        for name in ("force", "torque"):
            assert np.isfinite(np.asarray(result[name]["flow"], dtype=float)).all(), result[name]
    text = to_json(result, inf_nan_mode="constants", fallback=np.ndarray.tolist)
    assert b"NaN" not in text.replace(b'"NaN"', b"")
