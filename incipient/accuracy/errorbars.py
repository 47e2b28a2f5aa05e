"""Error bars on force, couple, safety factor and verdict, estimated by the run itself.

Each source of error is a term of its own:

- discretisation: steady flow by the dual-weighted residual (`dual`); flow in time, or a moving grain,
  by the same run on a coarser mesh with longer steps;
- gap: a grain at rest on a bed is computed with a gap. Coarse runs with one, two and four times the gap show
  how force and couple go with it, and what closing it would change;
- domain: a coarse run with inflow, outflow and a free top farther away shows what they change.

Terms are added in absolute value: an error bar is not a standard deviation.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..contact import Contacts, Load
from ..contact.exact import MassAndInertia, judged
from ..errors import IncipientError
from ..judgement import load_of, mass_and_inertia
from ..result import Couples, Forces, Result
from ..scene import Scene
from .dual import GoalErrors

if TYPE_CHECKING:
    from mpi4py import MPI

    from ..simulation import Simulation

Floats = NDArray[np.float64]
Solve = Callable[[Scene], "Loads"]

# Coarse runs for the terms of the model: order, and mesh_size at least.
MODEL_ORDER, MODEL_MESH = 2, 1.4
FARTHER = 1.5  # how much larger the domain of the domain's term is
DECAY = 2.0  # the influence of sides is taken to fall off like their distance to this power
COARSER_MESH, LONGER_STEP = 2.0**0.5, 2.0
ORDERS = (0.3, 2.0)  # between which the order in the gap is believed
# Three loads change too little to tell an order: below this share of the largest.
TOO_LITTLE = 1e-6


@dataclass(frozen=True)
class Loads:
    """Force and couple (3,) of the flow on a grain, and place and turn (3,) of one that moves."""

    force: Floats
    couple: Floats
    place: Floats | None = None

    @classmethod
    def of(cls, result: Result) -> Loads:
        """Those of a run with a grain, at its end."""
        assert result.force is not None and result.couple is not None
        place = None
        if result.trajectory is not None:
            place = np.array([*result.trajectory["place"], result.trajectory["angle"]])
        return cls(result.force.flow, result.couple.flow, place)


@dataclass(frozen=True)
class Term:
    """One source of error: absolute errors of force and couple (3,), of the place of a moving grain, and how found."""

    name: str
    force: Floats
    couple: Floats
    how: str
    place: Floats | None = None


@dataclass(frozen=True)
class SafetyBar:
    """The safety factor over all loads within the error bars, whether they all give one mode, and what to improve.

    decisive: the term without which the range of safety factors would shrink most
    """

    value: float
    low: float
    high: float
    certain: bool
    modes: tuple[str, ...]
    decisive: str

    def sentence(self) -> str:
        """What the error bars mean for the verdict."""
        between = f"safety factor {self.value:.4g}, between {self.low:.4g} and {self.high:.4g}"
        if self.certain:
            return f"certain within the error bars: {between}"
        return f"NOT certain: {between}; to decide, reduce the error of the {self.decisive}"


@dataclass(frozen=True)
class ErrorBars:
    """The error terms of a run, terms that were left out with the reason, and what they mean for the verdict."""

    terms: tuple[Term, ...]
    left_out: dict[str, str] = field(default_factory=dict)
    safety: SafetyBar | None = None

    @property
    def force(self) -> Floats:
        """(3,) absolute error of the force."""
        return np.sum([term.force for term in self.terms], axis=0) if self.terms else np.full(3, np.nan)

    @property
    def couple(self) -> Floats:
        """(3,) absolute error of the couple."""
        return np.sum([term.couple for term in self.terms], axis=0) if self.terms else np.full(3, np.nan)

    @property
    def place(self) -> Floats | None:
        """(3,) absolute error of place and turn of a moving grain."""
        places = [term.place for term in self.terms if term.place is not None]
        return np.sum(places, axis=0) if places else None

    def to_dict(self) -> dict[str, Any]:
        """Plain data for result.json."""
        return {
            "force": self.force,
            "couple": self.couple,
            "place": self.place,
            "terms": [asdict(term) for term in self.terms],
            "left_out": self.left_out,
            "safety_factor": None if self.safety is None else asdict(self.safety),
        }


def error_bars(simulation: Simulation, force: Forces, couple: Couples) -> ErrorBars:
    """The error bars of a finished run with a grain; coarse runs of their own are made where needed. Collective.

    A term whose coarse run fails is left out, and the reason said. What `simulation.known` holds, terms by name and
    loads of coarse runs by the JSON of their scene, is not computed again, and what is found is added to it.
    """
    bars = _in_time(simulation, force, couple) if simulation.scene.time else _steady(simulation)
    scene, contacts = simulation.scene, simulation.contacts
    if contacts is None or scene.contact is None or scene.body is None or scene.body.density is None:
        return bars
    assert scene.grain is not None and scene.placement is not None
    inert = mass_and_inertia(scene.grain, scene.body.density, scene.placement)
    load = load_of(scene, force, couple)
    return replace(bars, safety=bar_of_safety(load, contacts, scene.contact.friction, inert, bars.terms))


def _in_time(simulation: Simulation, force: Forces, couple: Couples) -> ErrorBars:
    place = None
    if simulation.trajectory is not None:
        state = simulation.trajectory.state
        place = np.concatenate([state.place, state.orientation])
    computed = Loads(force.flow, couple.flow, place)
    found = _Found(simulation)
    found.add("discretisation", lambda solve: by_coarser_run(simulation.scene, computed, solve))
    return found.bars({"gap": "not estimated for flow in time", "domain": "not estimated for flow in time"})


def _steady(simulation: Simulation) -> ErrorBars:
    scene, placement, found = simulation.scene, simulation.layout.placement, _Found(simulation)
    assert placement is not None

    def dual(solve: Solve) -> Term:
        with GoalErrors(simulation.fluid, "body", placement.centre) as goals:
            return by_dual(goals.force, goals.couple)

    left_out = {}
    found.add("discretisation", dual)
    if simulation.plan.has("contact"):
        found.add("gap", lambda solve: of_gap(scene, solve))
    else:
        left_out["gap"] = "no grain rests on a bed"
    if reason := has_no_far_sides(scene):
        left_out["domain"] = reason
    else:
        found.add("domain", lambda solve: of_domain(scene, solve))
    return found.bars(left_out)


class _Found:
    """Terms as they are found; each coarse run is made once."""

    def __init__(self, simulation: Simulation):
        self._comm, self._terms, self._failed = simulation.comm, list[Term](), dict[str, str]()
        self._known = simulation.known

    def add(self, name: str, estimate: Callable[[Solve], Term]) -> None:
        try:
            term = self._known.get(name)
            if not isinstance(term, Term):
                term = self._known[name] = estimate(self._solve)
            self._terms.append(term)
        except IncipientError as error:
            self._failed[name] = str(error)

    def bars(self, left_out: dict[str, str]) -> ErrorBars:
        return ErrorBars(tuple(self._terms), {**left_out, **self._failed})

    def _solve(self, scene: Scene) -> Loads:
        key = scene.model_dump_json()
        loads = self._known.get(key)
        if not isinstance(loads, Loads):
            loads = self._known[key] = loads_of(scene, self._comm)
        return loads


def loads_of(scene: Scene, comm: MPI.Comm) -> Loads:
    """Run a scene for its force and couple at the end. Collective."""
    from ..simulation import simulate

    return Loads.of(simulate(scene, comm))


# -- the terms --------------------------------------------------------------------------------------


def by_dual(force: Floats, couple: Floats) -> Term:
    """The term of the discretisation from the errors that `dual.GoalErrors` estimates."""
    return Term("discretisation", np.abs(force), np.abs(couple), "dual-weighted residual, one order more")


def by_coarser_run(scene: Scene, computed: Loads, solve: Solve) -> Term:
    """The term of mesh and time step together, from a run with both coarser, at second order or better."""
    assert scene.time is not None
    order = 2 if scene.time.scheme == "bdf2" else 1
    other = solve(coarser(scene))
    share = 1.0 / (LONGER_STEP**order - 1.0)
    place = None
    if computed.place is not None and other.place is not None:
        place = share * np.abs(computed.place - other.place)
    how = f"a run with mesh x {COARSER_MESH:.3g} and steps x {LONGER_STEP:g}, extrapolated at order {order}"
    return Term(
        "discretisation",
        share * np.abs(computed.force - other.force),
        share * np.abs(computed.couple - other.couple),
        how,
        place,
    )


def coarser(scene: Scene) -> Scene:
    """The scene in time on a coarser mesh with longer steps; where steps adapt, with a larger error of each."""
    assert scene.time is not None
    time = {"step": min(LONGER_STEP * scene.time.step, scene.time.end)}
    if scene.time.tolerance is not None:
        order = 2 if scene.time.scheme == "bdf2" else 1
        time["tolerance"] = LONGER_STEP ** (order + 1) * scene.time.tolerance
    mesh_size = min(COARSER_MESH * scene.numerics.mesh_size, 100.0)
    return changed(scene, numerics={"mesh_size": mesh_size, "error_bars": False}, time=time)


def of_gap(scene: Scene, solve: Solve) -> Term:
    """What closing the gap between grain and bed would change, from coarse runs with larger gaps."""
    loads = [solve(_coarse(scene, contact=_with_gap(scene, factor))) for factor in (1.0, 2.0, 4.0)]
    values = [np.concatenate([one.force, one.couple]) for one in loads]
    errors = np.array([_to_zero(*three) for three in zip(*values, strict=True)])
    return Term(
        "gap", errors[:3], errors[3:], "coarse runs with 1, 2 and 4 times the gap, extrapolated to none"
    )


def _with_gap(scene: Scene, factor: float) -> dict[str, Any]:
    """The section of contact with a larger gap; friction plays no part in the flow."""
    size = scene.grain.size if scene.grain is not None else 1.0
    friction = scene.contact.friction if scene.contact is not None else 0.0
    return {"gap": factor * scene.contact_gap / size, "friction": friction}


def _to_zero(at_one: float, at_two: float, at_four: float) -> float:
    """|value without gap - value at the gap|, for a value that goes as a power of the gap."""
    near, far = at_two - at_one, at_four - at_two
    if abs(near) <= TOO_LITTLE * max(abs(at_one), abs(at_two), abs(at_four)):
        return abs(near)
    order = float(np.clip(np.log2(max(far / near, 1e-3)), *ORDERS))
    return abs(near) / (2.0**order - 1.0)


def of_domain(scene: Scene, solve: Solve) -> Term:
    """What sides that stand for an endless flow change, from a coarse run with all of them farther away."""
    larger = solve(_coarse(farther(scene)))
    smaller = solve(_coarse(scene))
    share = 1.0 / (1.0 - FARTHER**-DECAY)
    how = f"a coarse run with sides {FARTHER:g} times as far, decay with distance to the power {DECAY:g}"
    return Term(
        "domain",
        share * np.abs(larger.force - smaller.force),
        share * np.abs(larger.couple - smaller.couple),
        how,
    )


def farther(scene: Scene) -> Scene:
    """The scene with inflow, outflow and a free top farther away, at the same viscosity."""
    domain = scene.domain
    before = 0.5 * (FARTHER - 1.0) * domain.length
    period = getattr(scene.bed, "wavelength", None) or getattr(scene.bed, "spacing", None)
    if period is not None:  # the flow enters at the same height of the bed
        before = period * np.ceil(before / period)
    changes: dict[str, Any] = {
        "origin": (domain.origin[0] - before, domain.origin[1]),
        "length": domain.length + 2.0 * before,
    }
    if scene.top == "stream":
        changes["height"] = FARTHER * domain.height
    if scene.fluid.scale == "flow" and "height" in changes:
        # The viscosity stays: the Reynolds number is that of a higher domain.
        return changed(scene, domain=changes, fluid={"reynolds": FARTHER * scene.fluid.reynolds})
    return changed(scene, domain=changes)


def _coarse(scene: Scene, **sections: dict[str, Any]) -> Scene:
    numerics = {
        "order": MODEL_ORDER,
        "geometry_order": None,
        "mesh_size": max(MODEL_MESH, scene.numerics.mesh_size),
        "error_bars": False,
    }
    return changed(scene, numerics=numerics, **sections)


def changed(scene: Scene, **sections: dict[str, Any]) -> Scene:
    """The scene with some keys of some sections changed, checked anew.

    Raises SceneError if the changed scene contradicts itself.
    """
    plain = scene.model_dump()
    for name, keys in sections.items():
        plain[name] = {**(plain[name] or {}), **keys}
    return Scene(**plain)


def has_no_far_sides(scene: Scene) -> str:
    """Why there is no term of the domain, or nothing."""
    if scene.domain.kind == "box":
        return "the domain is closed by walls"
    if scene.bed is not None and scene.bed.kind == "polyline":
        return "the bed is known only as far as its points reach"
    return ""


# -- the verdict ------------------------------------------------------------------------------------


def bar_of_safety(
    load: Load, contacts: Contacts, friction: float, inert: MassAndInertia | None, terms: tuple[Term, ...]
) -> SafetyBar:
    """The exact judge's answers at all corners of the error bars, and at the load itself."""

    def answers(terms: tuple[Term, ...]) -> list[tuple[float, str]]:
        found = []
        for corner in _corners(load, ErrorBars(terms)):
            exact = judged(corner, contacts, friction, inert)
            found.append((exact.safety.value, exact.label))
        return found

    everything = answers(terms)
    factors, modes = zip(*everything, strict=True)
    widths = {}
    for term in terms:
        left = [value for value, _ in answers(tuple(one for one in terms if one is not term))]
        widths[term.name] = _width(left)
    return SafetyBar(
        value=factors[0],
        low=min(factors),
        high=max(factors),
        certain=len(set(modes)) == 1,
        modes=tuple(dict.fromkeys(modes)),
        decisive=min(widths, key=lambda name: widths[name], default=""),
    )


def _width(factors: list[float]) -> float:
    """Of a range of safety factors, on the scale of 1/(1 + factor), where infinity is a number, too."""
    shares = [1.0 / (1.0 + factor) for factor in factors]
    return max(shares) - min(shares)


def _corners(load: Load, bars: ErrorBars) -> list[Load]:
    """The load itself and the loads at the corners of the error bars."""
    if not bars.terms:
        return [load]
    errors = np.concatenate([bars.force, bars.couple])
    which = np.flatnonzero(errors > 0.0)
    loads = [load]
    for signs in itertools.product((-1.0, 1.0), repeat=len(which)):
        change = np.zeros(6)
        change[which] = np.array(signs) * errors[which]
        loads.append(
            Load(load.flow_force + change[:3], load.flow_couple + change[3:], load.weight, load.centre)
        )
    return loads
