"""Turbulence of the flow, by a model of its means."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ..planning.effects import transition
from ..results.quantity import OutputQuantity, at
from ..setup.setup import Setup


def _of_shear_velocity(stored: Mapping[str, Any]) -> tuple[float, float] | None:
    error, u = at(stored, "error_bars.shear_velocity.0"), stored["turbulence"]["at_outflow"]
    return None if error is None or not u else (max(u - error, 0.0), u + error)


def _of_friction(stored: Mapping[str, Any]) -> tuple[float, float] | None:
    """Error bar of C_f, which scales with the square of u*."""
    ends, walls = _of_shear_velocity(stored), stored["turbulence"]
    if ends is None:
        return None
    low, high = (walls["friction"] * (end / walls["at_outflow"]) ** 2 for end in ends)
    return low, high


# What a threshold is of, beside its Shields number.
TURBULENT = (
    "in mean turbulent flow over one grain{plane}, tau_b of the inflow; gusts move it sooner, see "
    "incipient entrainment"
)
LAMINAR = "in steady laminar {flow} over one grain{plane}; for Shields numbers by probability see incipient entrainment"
OSCILLATING = "in laminar {flow} over one grain{plane}; tau_b is the largest of a period"


def _roughness_reynolds(stored: Mapping[str, Any]) -> float | None:
    walls = stored.get("turbulence") or {"roughness": 0.0}
    if not walls["roughness"]:
        return None
    return walls["shear_velocity"] * walls["roughness"] / walls["viscosity"]


def _at_walls(key: str, words: str, short: str, column: str = "", **more: Any) -> OutputQuantity:
    return OutputQuantity(
        f"turbulence.{key}",
        words,
        column=column,
        heading="at the walls",
        line="turbulence",
        short=short,
        **more,
    )


QUANTITIES = (
    _at_walls("least", "least y+ of the walls", "y+ from", "y_plus_min"),
    _at_walls("largest", "largest y+ of the walls", "to", "y_plus_max"),
    _at_walls(
        "roughness_reynolds",
        "roughness Reynolds number u* k_s/nu",
        "u* k_s/nu",
        derive=_roughness_reynolds,
    ),
    _at_walls(
        "at_outflow",
        "shear velocity u* at the outflow",
        "u* at the outflow",
        "bed_shear_velocity",
        ends=_of_shear_velocity,
    ),
    _at_walls("friction", "friction C_f at the outflow", "C_f", "friction", ends=_of_friction),
    _at_walls(
        "shear_velocity",
        "shear velocity u* along the walls, mean",
        "mean u* along the walls",
        error="error_bars.shear_velocity.1",
    ),
    *(
        OutputQuantity(
            f"turbulence.separated.{end}",
            f"x at which the flow along the bed {does}",
            "length",
            column,
            error=f"error_bars.separated.{end}",
            heading="at the walls",
        )
        for end, (does, column) in enumerate(
            (("separates", "separation"), ("reattaches", "reattachment"))
        )
    ),
    OutputQuantity("turbulence.spread", "spread of the loads", column="load_spread"),
)
HOLDS = 1e-3  # Shields number of a flow that a 3-D search begins with if it holds the grain
SLOW = 20.0  # Reynolds number by depth and mean velocity of the slowest flow that a search looks at


def slowest_flow(setup: Setup) -> tuple[float, float] | None:
    """Factors on the scene's flow of the slowest, laminar flow of a search, and of a first guess; None: no model.

    In 3-D the guess is a low Shields number; a search begins there if it holds the grain. In 2-D it is zero.
    """
    if not setup.is_averaged:
        return None
    slowest = SLOW * setup.walls.viscosity / (setup.walls.mean * setup.walls.depth)
    low = HOLDS * setup.stress_unit / setup.bed_stress() if setup.scene.gdim == 3 else 0.0
    return slowest, low**0.5


def threshold_notes(setup: Setup, factor: float) -> Iterator[str]:
    """Flow of a threshold at a factor of the scene's, and whether it can be laminar."""
    plane, scene = " in 2-D" if setup.scene.gdim == 2 else "", setup.scene
    about = TURBULENT if scene.is_averaged else OSCILLATING if scene.flow.oscillates else LAMINAR
    yield about.format(flow=f"{scene.flow.kind} flow", plane=plane)
    if transitional := transition(setup, factor, " at the threshold"):
        yield transitional
