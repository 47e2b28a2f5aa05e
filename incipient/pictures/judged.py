"""Contents of a picture of a verdict: load, contact forces in their cones, incipient motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..contact import Contacts, Load, incipient_motion
from ..contact.friction import FrictionCone
from ..contact.problem import ContactProblem
from ..contact.safety import cone_states, forces_that_balance
from ..errors import ConvergenceError

_BEYOND = 1e-4  # how much more than the critical load shows the motion
_PAPER = "; by the paper's criteria"


@dataclass(frozen=True, eq=False)
class Judged:
    """A case and the verdicts of both criteria.

    forces: of the contacts on the grain (n, 3); states: (n,), keys of `style.STATES`
    share: fraction of the flow's load that these forces balance, NaN without any
    motion: incipient accelerations (2, 3): of the centre of mass, and angular
    verdict: as stored
    """

    load: Load
    contacts: Contacts
    friction: float
    forces: np.ndarray
    states: tuple[str, ...]
    share: float
    motion: np.ndarray | None
    sentences: tuple[str, str]
    safety_factor: float
    verdict: dict[str, Any]

    @property
    def significant(self) -> tuple[int, ...]:
        """Indices of the contacts of the paper's significant reaction surface."""
        return tuple(self.verdict["judges"]["criteria"]["significant"])

    def tables(self, unit: str = "scene units") -> dict[str, dict[str, Any]]:
        """Load, and numbers of both criteria, by heading and label; vectors without zero components in 2-D."""
        axes, about = (slice(2), 2) if self.planar else (slice(3), slice(3))
        names = {"flow": "force of the flow", "weight": "submerged weight"}
        load = {names.get(name, name): force[axes] for name, force in self.acting.items()}
        load["torque about the centre"] = self.load.flow_couple[about]
        paper = self.verdict["judges"]["criteria"]
        exact = {
            "mode": self.verdict["mode"],
            "safety factor on the flow": self.safety_factor,
            "coefficient of static friction": self.friction,
        }
        if self.motion is not None:
            exact["acceleration"] = self.motion[0][axes]
            exact["angular acceleration"] = self.motion[1][about]
        residual = {
            "residual force": np.array(paper["force"])[axes],
            "residual torque": np.array(paper["torque"])[about],
        }
        heading = f"The paper's criteria: row {paper['row']} of its table"
        return {f"Load on the grain [{unit}]": load, "Exact criterion": exact, heading: residual}

    @property
    def planar(self) -> bool:
        load, contacts = self.load, self.contacts
        vectors = (contacts.points, contacts.normals, load.flow_force, load.weight)
        return not any(v[..., 2].any() for v in vectors) and not load.flow_couple[:2].any()

    @property
    def acting(self) -> dict[str, np.ndarray]:
        """Forces on the grain other than the bed's (3,); without weight the flow's alone."""
        load = self.load
        more = {"weight": load.weight, "resultant": load.force} if load.weight.any() else {}
        return {"flow": load.flow_force} | more

    @property
    def largest(self) -> float:
        every = [*self.forces, *self.acting.values()]
        return float(np.linalg.norm(every, axis=1).max()) or 1.0

    @property
    def occasion(self) -> str:
        if not math.isfinite(self.share):
            return "no contact forces balance the load"
        if self.share != 1.0:
            return f"contact force that balances {self.share:.4g} times the flow's load"
        when = (
            " as it begins to move" if self.motion is not None else ", a set that balances the load"
        )
        return f"contact force on the grain{when}"


def judged(verdict: dict[str, Any]) -> Judged:
    """A stored verdict, with the contact forces at the actual load. Raises KeyError for an incomplete one."""
    paper, exact = verdict["judges"]["criteria"], verdict["judges"]["equilibrium"]
    load = Load(
        **{name: paper["load"][name] for name in ("flow_force", "flow_couple", "weight", "centre")}
    )
    contacts = Contacts(*(paper["contacts"][name] for name in ("points", "normals", "areas")))
    friction, motion = float(paper["friction"]), exact["motion"]
    forces, states, share = _forces(exact, load, contacts, _law(verdict))
    first, _, second = verdict["sentence"].partition(_PAPER)
    factor = verdict["safety_factor"]
    return Judged(
        load=load,
        contacts=contacts,
        friction=friction,
        forces=forces,
        states=states,
        share=share,
        motion=None if motion is None or motion["mode"] == "REST" else _motion(motion),
        sentences=(sentence(first), sentence(_PAPER[2:] + second) if second else ""),
        safety_factor=math.inf if factor is None else factor,
        verdict=verdict,
    )


def _motion(stored: dict[str, Any]) -> np.ndarray:
    return np.array([stored["acceleration"], stored["angular_acceleration"]])


def at_onset(case: Judged, mode: str, mass: float, inertia: np.ndarray) -> Judged:
    """A case at its critical load with the motion of a mode that begins just above it."""
    load, more = case.load, 1.0 + _BEYOND
    stronger = replace(load, flow_force=more * load.flow_force, flow_couple=more * load.flow_couple)
    try:
        onset = incipient_motion(
            stronger, case.contacts, _law(case.verdict), mass, inertia
        ).to_dict()
    except ConvergenceError:
        return case
    return replace(
        case,
        motion=_motion(onset),
        forces=np.array(onset["contact_forces"]),
        states=tuple(onset["contact_states"]),
        share=1.0,
        verdict={**case.verdict, "mode": mode},
    )


def _forces(
    exact: dict[str, Any], load: Load, contacts: Contacts, law: FrictionCone
) -> tuple[np.ndarray, tuple[str, ...], float]:
    motion, safety = exact["motion"], exact["safety"]
    if motion is not None:
        return np.array(motion["contact_forces"]), tuple(motion["contact_states"]), 1.0
    if safety["held"]:
        problem = ContactProblem.of(load, contacts, law)
        if (held := forces_that_balance(problem, 1.0)) is not None:
            sizes = np.linalg.norm(held, axis=2)
            states = cone_states(problem, held, sizes, float(sizes.max()))
            return problem.forces(held[0]), tuple(state.name for state in states), 1.0
    share = math.nan if safety["factor"] is None else float(safety["factor"])
    return np.array(safety["contact_forces"]), tuple(safety["contact_states"]), share


def _law(verdict: dict[str, Any]) -> FrictionCone:
    judges = verdict["judges"]
    return FrictionCone.of(judges["criteria"]["friction"], judges["equilibrium"]["cohesion"])


def pressed(forces: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Magnitudes (n,) of contact forces (n, 3) along the inward normals and along the surface."""
    normal = -(forces * normals).sum(axis=1)
    return normal, np.linalg.norm(forces + normal[:, None] * normals, axis=1)


def sentence(words: str) -> str:
    """Words with a capital, a full stop, and the paper's quotation marks and symbols as printed."""
    words = words.strip().rstrip(".")
    for typed, printed in (
        ("``", "“"),
        ("''", "”"),
        ("-F_tau", "−F_τ"),
        ("F_tau", "F_τ"),
        ("+-", "±"),
    ):
        words = words.replace(typed, printed)
    return f"{words[:1].upper()}{words[1:]}."
