"""The critical flow: how fast the scene's flow must be for its grain to begin to move.

The flow is made faster by a factor at the same viscosity, grain and gravity. The safety factor S of the
load at a factor is one where the grain first moves. In Stokes flow the load is proportional to the factor
and one solve is enough; otherwise the root of log S against the logarithm of the factor is found by
secants inside a bracket, each solve starting from the flow before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import ConvergenceError, SceneError
from .outcome import cost
from .progress import Silent
from .scene import Scene

if TYPE_CHECKING:
    from mpi4py import MPI

    from .contact import Contacts, Load
    from .contact.verdict import Verdict
    from .simulation import Simulation

SCHEMA_VERSION = 1
TOLERANCE = 1e-6  # of the critical factor, relative
MAX_SOLVES = 40
BEYOND = 1e-4  # how much more than the critical load shows the motion
LARGEST_STEP = 30.0  # times faster or slower from one solve to the next


@dataclass(frozen=True)
class Trial:
    """The flow faster by `factor`, and the safety factor of the grain in it."""

    factor: float
    safety_factor: float


@dataclass(frozen=True)
class Threshold:
    """The critical flow of a scene, or why there is none.

    factor:          critical speed over that of the scene; 0: any flow moves it, or its weight alone does;
                     inf: no flow moves it
    shields:         Shields number tau_b / ((rho_s - rho_f) g d), tau_b of the undisturbed flow at its datum
    reynolds:        the scene's Reynolds number, critical
    shear_reynolds:  u* d / nu with u*^2 = tau_b / rho_f
    mode:            how the grain begins to move, by the exact judge
    load:            the load at the threshold, which the contact forces balance
    verdict:         both judges at the threshold
    trials:          the flows solved on the way
    """

    factor: float
    shields: float
    reynolds: float
    shear_reynolds: float
    mode: str
    load: Load
    contact_forces: np.ndarray
    contacts: Contacts
    verdict: dict[str, Any]
    trials: tuple[Trial, ...]
    cost: dict[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain data for threshold.json."""
        names = ("factor", "shields", "reynolds", "shear_reynolds", "mode", "verdict", "cost")
        return {
            **{name: getattr(self, name) for name in names},
            "schema_version": SCHEMA_VERSION,
            "load": asdict(self.load),
            "contacts": {**asdict(self.contacts), "forces": self.contact_forces},
            "trials": [asdict(trial) for trial in self.trials],
        }

    def text(self) -> str:
        """The outcome in a few lines."""
        if self.factor == 0.0 and self.verdict["safety_status"] == "AT_ONCE":
            return f"threshold           zero: any flow moves the grain, {self.mode}"
        if self.factor == 0.0:
            return (
                "threshold           none: the grain moves without any flow; with body.settle = true it first rolls "
                "and tips to a place where it rests"
            )
        if not np.isfinite(self.factor):
            return "threshold           none: no strength of this flow moves the grain"
        return (
            f"threshold           {self.factor:.6g} times the flow of the scene; then the grain begins {self.mode}\n"
            f"Shields number      {self.shields:.6g}\n"
            f"Reynolds number     {self.reynolds:.6g}   shear Reynolds number {self.shear_reynolds:.6g}\n"
            f"flows solved        {len(self.trials)}"
        )


def find_threshold(scene: Scene, comm: MPI.Comm, voice: Silent | None = None) -> Threshold:
    """Find the critical flow of a scene with a grain resting on a bed. Collective.

    Raises:
        SceneError: the scene has no weight, friction or bed to judge the grain by, or is time-dependent.
        ConvergenceError: the flow has no steady state up to the threshold; says how far it got.
    """
    from .recorder import Unrecorded
    from .simulation import Simulation

    _require(scene)
    if scene.fluid.inertia and scene.effects.inertia == "auto":
        # Where the plan would leave inertia out, it may matter at the threshold.
        scene = scene.model_copy(update={"effects": scene.effects.model_copy(update={"inertia": True})})
    simulation = Simulation(scene, comm, Unrecorded(), voice or Silent())
    with simulation.prepared():
        return _Search(simulation).threshold()


def _require(scene: Scene) -> None:
    body = scene.body
    needs = (
        (
            body is not None and body.x is not None and scene.bed is not None,
            "a grain that rests on a bed (body.x and [bed])",
        ),
        (
            (scene.density or 0.0) > 1.0,
            "a grain denser than the fluid (body.density > 1)",
        ),
        (
            scene.gravity is not None and scene.gravity.acceleration > 0.0,
            "gravity ([gravity] acceleration > 0)",
        ),
        (scene.contact is not None, "friction ([contact] friction)"),
        (scene.time is None, "a steady flow (no [time] section)"),
        (scene.flow.kind != "still", "a flow (flow.kind other than still)"),
    )
    for met, need in needs:
        if not met:
            raise SceneError(f"a threshold needs {need}")


class _Search:
    """Root finding on the safety factor."""

    def __init__(self, simulation: Simulation):
        self.simulation = simulation
        assert simulation.contacts is not None
        self.contacts: Contacts = simulation.contacts
        self.friction = simulation.scene.contact.friction if simulation.scene.contact else 0.0
        self.trials: list[Trial] = []
        self.load: Load | None = None

    def threshold(self) -> Threshold:
        """Solve until the safety factor is one, or say why it never is. Collective."""
        first = self._try(1.0)
        if first.safety_factor in (0.0, np.inf):
            return self._found(first.safety_factor)
        factor = first.safety_factor
        if self.simulation.plan.has("inertia"):
            factor = find_root(self._excess, 1.0, np.log(first.safety_factor))
        else:
            # The load is proportional to the speed: the flow need not be solved again.
            self.load = _stronger(self.load, factor)
        return self._found(factor)

    def _excess(self, factor: float) -> float:
        """log S: zero at the threshold."""
        value = self._try(factor).safety_factor
        return float(np.log(value)) if value > 0 else -np.inf

    def _try(self, factor: float) -> Trial:
        from .contact import equilibrium
        from .judgement import load_of

        try:
            force, couple = self.simulation.loads_at(factor)
        except ConvergenceError as error:
            raise ConvergenceError(f"at {factor:.4g} times the flow of the scene: {error}") from None
        self.load = load_of(self.simulation.scene, force, couple)
        value = equilibrium.safety_factor(self.load, self.contacts, self.friction).value
        self.trials.append(Trial(factor, value))
        self.simulation.voice.say(f"flow x {factor:.6g}: safety factor {value:.6g}")
        return self.trials[-1]

    def _found(self, factor: float) -> Threshold:
        scene, load = self.simulation.scene, self.load
        assert load is not None
        critical = self._judged(load)
        stress = factor * bed_stress(scene)
        return Threshold(
            factor=factor,
            shields=stress / _stress_unit(scene),
            reynolds=factor * scene.fluid.reynolds,
            shear_reynolds=float(np.sqrt(stress) * _size(scene) / scene.viscosity),
            mode=self._mode(factor),
            load=load,
            contact_forces=critical.equilibrium.safety.contact_forces,
            contacts=self.contacts,
            verdict=critical.to_dict(),
            trials=tuple(self.trials),
            cost=cost(self.simulation),
        )

    def _mode(self, factor: float) -> str:
        """How the grain begins to move when the flow is a little stronger than critical."""
        if not np.isfinite(factor):
            return "rest"
        assert self.load is not None
        load = self.load if factor == 0.0 else _stronger(self.load, 1.0 + BEYOND)
        return self._judged(load).equilibrium.label

    def _judged(self, load: Load) -> Verdict:
        from .contact.verdict import judge
        from .judgement import mass_and_inertia

        scene = self.simulation.scene
        assert scene.body is not None
        return judge(load, self.contacts, self.friction, mass_and_inertia(scene.body))


def find_root(excess: Callable[[float], float], factor: float, value: float) -> float:
    """The factor at which a decreasing function of log factor crosses zero, from its value at one factor.

    Secants in the logarithms, kept inside the bracket as soon as there is one; the first step takes the
    slope -1 of a load proportional to the speed.

    Raises:
        ConvergenceError: no root within forty evaluations.
    """
    low, high = -np.inf, np.inf
    x, y, slope = float(np.log(factor)), value, -1.0
    for _ in range(MAX_SOLVES):
        low, high = (x, high) if y > 0 else (low, x)
        step = -y / slope if np.isfinite(y) else -np.log(2.0)
        if abs(step) < TOLERANCE or high - low < TOLERANCE:
            return float(np.exp(x + step if low <= x + step <= high else x))
        new = x + float(np.clip(step, -np.log(LARGEST_STEP), np.log(LARGEST_STEP)))
        if not low < new < high:
            new = 0.5 * (low + high)
        result = excess(float(np.exp(new)))
        if np.isfinite(result) and np.isfinite(y):
            slope = min((result - y) / (new - x), -1e-3)
        x, y = new, result
    raise ConvergenceError(
        f"no threshold found within {MAX_SOLVES} flows; the last factor was {np.exp(x):.4g}"
    )


def bed_stress(scene: Scene) -> float:
    """Shear stress of the undisturbed flow at its datum, scene units with fluid density one. Not collective.

    It is that of the flow's profile, the same over the whole bed; of a flow given by formulas, at the inflow.
    """
    from .boundaries import undisturbed

    step = 1e-6 * scene.domain.height
    heights = scene.datum + step * np.array([0.0, 1.0, 2.0])
    x = np.vstack([np.full(3, scene.domain.left), heights, np.zeros(3)])
    speed = undisturbed(scene)(x, 0.0)[0]
    gradient = (-3 * speed[0] + 4 * speed[1] - speed[2]) / (2 * step)
    return float(scene.viscosity * abs(gradient))


def _stress_unit(scene: Scene) -> float:
    """(rho_s - rho_f) g d."""
    assert scene.gravity is not None and scene.density is not None
    return (scene.density - 1.0) * scene.gravity.acceleration * _size(scene)


def _size(scene: Scene) -> float:
    assert scene.grain is not None
    return scene.grain.size


def _stronger(load: Load | None, factor: float) -> Load:
    """The load with the flow's part multiplied."""
    from .contact import Load

    assert load is not None
    return Load(factor * load.flow_force, factor * load.flow_couple, load.weight, load.centre)
