"""The goal quantity of an accuracy: its relative error, and its sensitivities to force and torque."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Floats
from ..contact import Contacts, Load
from ..contact.friction import Law
from ..contact.robustness import SafetyRange, safety_range
from ..contact.safety import safety_factor
from ..results.errorbars import SafetyBar
from ..results.loads import COMPONENTS
from ..scene import Scene
from ..scene.sections import OF_GRAIN, OF_SURFACE, OF_WALLS
from ..setup.setup import Setup
from ..simulation.loads import load_of

if TYPE_CHECKING:
    from ..results.errorbars import Loads, Term

STILL = 1e-6  # velocity, relative to the flow's, that counts as zero
# Errors (6,) of force and torque by source.
Errors = Mapping[str, Floats]


def relative(goal: Goal, loads: Loads, term: Term) -> float | None:
    """Relative error of a load, elevation or u* from a term of the error bars; None: not known.

    For elevations: the largest error within the run, or at the end, over the largest elevation. For velocity and spin:
    see `_of_motion`.
    """
    if goal.name == OF_WALLS and "shear_velocity" in term.others:
        place = place_of_shear_velocity(goal.scene)
        return float(term.others["shear_velocity"][place] / loads.others["shear_velocity"][place])
    if goal.name in OF_SURFACE:
        error, elevations = term.others.get(goal.name), loads.others.get("elevation")
        if error is None or elevations is None:
            return None
        return _ratio(float(error.max(initial=0.0)), elevations.largest)
    if goal.name == OF_GRAIN and "velocity" in term.others:
        return _of_motion(goal, loads, term)
    return goal.error(loads, term.load) if len(loads.load) else None


def place_of_shear_velocity(scene: Scene) -> int:
    """Index of the representative of `WallReport.shear_velocities`: over a bed that is not planar, the mean.

    The stress at an outflow over a slope does not converge with the mesh.
    """
    return 0 if Setup(scene).walls.plane else 1


def _of_motion(goal: Goal, loads: Loads, term: Term) -> float:
    """Relative error of velocity and spin, which counts half of the size times; of a grain at rest of the force."""
    radius = 0.5 * goal.scene.grain.size
    speed, error = (
        float(np.linalg.norm([*motion["velocity"], *(radius * motion["spin"])]))
        for motion in (loads.others, term.others)
    )
    at_rest = max(speed, error) <= STILL * goal.scene.reference_velocity
    return goal.error(loads, term.load) if at_rest else _ratio(error, speed)


@dataclass(frozen=True)
class Goal:
    """A load or the safety factor of a grain; without a grain an elevation or u*.

    The error of a safety factor is the width of its range over its value, infinite if only one of them is.
    power: of the factor on the flow in the load, if the goal is the critical flow; its error is the larger distance
    from an end of its range.
    """

    name: str
    scene: Scene
    contacts: Contacts | None = None
    power: float | None = None

    @classmethod
    def of(cls, scene: Scene) -> Goal:
        verdict = scene.numerics.accuracy == "verdict"
        name = "safety factor" if verdict else scene.accuracy_of
        return cls(name, scene, Setup(scene).contacts if name == "safety factor" else None)

    def error(self, loads: Loads, of_load: Floats) -> float:
        """Relative error of the quantity, from errors (6,)."""
        if self.contacts is None:
            error = of_load[3:] if self.name == "torque" else of_load[:3]
            return _ratio(float(np.linalg.norm(error)), self._scale(loads))
        assert self.scene.contact is not None
        errors = {"discretisation": np.abs(of_load)}
        bar = bar_of_safety(
            load_of(self.scene, loads.load), self.contacts, self.scene.contact.law, errors
        )
        if self.power is None:
            return bar.relative
        low, high = ((end / bar.value) ** (1.0 / self.power) for end in (bar.low, bar.high))
        return max(high - 1.0, 1.0 - low)

    def goals(self, loads: Loads) -> list[Floats]:
        """Linear functionals of force and torque, (3 or 6,) each, whose errors are estimated."""
        gdim = self.scene.gdim
        mirrored = Setup(self.scene).mirrored  # no load across
        places = {i: k for i, k in enumerate(COMPONENTS[gdim]) if not (mirrored and k % 2)}
        if self.contacts is not None:
            slope = self._slope(loads, places)
            if np.all(np.isfinite(slope)) and np.any(slope):
                return [slope]
        units = np.eye(3 * gdim - 3)[[*places]] / (self._scale(loads) or 1.0)
        return [unit for unit in units if unit[gdim:].any() == (self.name == "torque")]

    def _scale(self, loads: Loads) -> float:
        size = float(np.linalg.norm(loads.force))
        if self.name != "torque":
            return size
        # Of a torque that vanishes because of symmetry: 1% of force times size.
        return max(float(np.linalg.norm(loads.torque)), 0.01 * size * self.scene.grain.size)

    def _slope(self, loads: Loads, places: dict[int, int]) -> Floats:
        """Derivatives (k,) of the logarithm of the factor along the components of the load."""
        load, scene, contacts = load_of(self.scene, loads.load), self.scene, self.contacts
        assert contacts is not None and scene.contact is not None and scene.grain is not None
        law, slopes = scene.contact.law, np.zeros(3 * scene.gdim - 3)
        step = 1e-4 * float(np.linalg.norm(loads.force))
        for i, place in places.items():
            length = step * (scene.grain.size if place > 2 else 1.0)
            ahead = length * np.eye(6)[place]
            ends = [load.shifted(sign * ahead) for sign in (-1.0, 1.0)]
            values = [safety_factor(end, contacts, law).value for end in ends]
            with np.errstate(divide="ignore", invalid="ignore"):
                slopes[i] = np.diff(np.log(values))[0] / (2.0 * length)
        return slopes / (self.power or 1.0)


def _ratio(error: float, scale: float) -> float:
    if error == 0.0:
        return 0.0
    return error / scale if scale > 0.0 else np.inf


def bar_of_safety(load: Load, contacts: Contacts, law: Law, errors: Errors) -> SafetyBar:
    """Safety bar over all loads within the sum of the errors, by `safety_range`."""

    def within(names: set[str]) -> SafetyRange:
        whole = sum((errors[name] for name in sorted(names)), np.zeros(6))
        return safety_range(load, contacts, law, np.diag(whole))

    common, value = within(set(errors)), safety_factor(load, contacts, law).value
    widths = {name: within(set(errors) - {name}).width for name in errors}
    return SafetyBar(
        value=value,
        low=min(common.low, value),
        high=max(common.high, value),
        certain=common.rests or common.moves,
        rests=common.rests,
        decisive=min(widths, key=lambda name: widths[name], default=""),
        some=common.possible,
        every=common.guaranteed,
    )
