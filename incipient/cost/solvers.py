"""Solver options the equations of a scene: what a ladder of runs varies besides order, mesh and time step.

A way is named by words joined by "+", such as "extrapolated+bdf1"; the empty name stands for the scene's own. A word
stands for settings that a user can make as well: keys of the scene, or options of PETSc.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..effects.plan import make_plan
from ..errors import SceneError
from ..planning.effects import EffectName
from ..planning.plan import Plan
from ..planning.tolerance import of_steady

if TYPE_CHECKING:
    from ..scene import Scene

OWN = "own"
LOOSEST = 1e-3  # to which a tolerance is enlarged at the most
Applies = Callable[["Scene", Plan], bool]
Sections = dict[str, dict[str, Any]]


def _always(scene: Scene, plan: Plan) -> bool:
    return True


def _in_time(scene: Scene, plan: Plan) -> bool:
    return plan.has(EffectName.UNSTEADINESS)


def _laminar_in_time(scene: Scene, plan: Plan) -> bool:
    return _in_time(scene, plan) and not scene.is_turbulent


def _convects(scene: Scene, plan: Plan) -> bool:
    return plan.has(EffectName.INERTIA) and not scene.is_turbulent


def _convects_in_time(scene: Scene, plan: Plan) -> bool:
    return _convects(scene, plan) and plan.has(EffectName.UNSTEADINESS)


def _convects_steadily(scene: Scene, plan: Plan) -> bool:
    return plan.has(EffectName.INERTIA) and scene.time is None


def _iterates(scene: Scene, plan: Plan) -> bool:
    return plan.has(EffectName.INERTIA) or scene.time is not None


def _has_free_body(scene: Scene, plan: Plan) -> bool:
    return plan.has(EffectName.FREE_BODY)


@dataclass(frozen=True)
class Solver:
    """A solver option, as the word for it stands in tables.

    said:    in words
    applies: whether it means anything for a scene with its plan
    numerics, time: keys of these sections with their values
    looser:  factor on the tolerances
    petsc:   options of PETSc
    """

    said: str
    applies: Applies
    numerics: Mapping[str, Any] = field(default_factory=dict)
    time: Mapping[str, Any] = field(default_factory=dict)
    looser: float = 1.0
    petsc: str = ""

    def sections(self, scene: Scene) -> Sections:
        """The keys, by section, that this way changes in a scene."""
        numerics = {**self.numerics, **(self._tolerances(scene) if self.looser > 1.0 else {})}
        sections = {"numerics": numerics, "time": dict(self.time)}
        return {name: keys for name, keys in sections.items() if keys}

    def _tolerances(self, scene: Scene) -> dict[str, float]:
        """The tolerances that end the iterations, enlarged, by key."""
        moves = scene.has_surface or (scene.body is not None and scene.body.moves)
        names = ("tolerance", "interface_tolerance") if moves else ("tolerance",)
        given = {name: of_steady(getattr(scene.numerics, name)) for name in names}
        return {name: max(value, min(self.looser * value, LOOSEST)) for name, value in given.items()}

    def is_own(self, scene: Scene, plan: Plan) -> bool:
        """Whether the scene is solved so anyway."""
        if "stabilisation" in self.numerics:
            return plan.stabilisation.present == (self.numerics["stabilisation"] == "on")
        same = (
            getattr(getattr(scene, name), key) == value
            for name, keys in self.sections(scene).items()
            for key, value in keys.items()
        )
        return not self.petsc and all(same)


WORDS: dict[str, Solver] = {
    "implicit": Solver("convection iterated in each step", _convects_in_time, {"convection": "implicit"}),
    "extrapolated": Solver(
        "convection linearised about earlier steps", _convects_in_time, {"convection": "extrapolated"}
    ),
    "bdf1": Solver("backward differences of first order", _in_time, time={"scheme": "bdf1"}),
    "bdf2": Solver("backward differences of second order", _in_time, time={"scheme": "bdf2"}),
    "chords": Solver(
        "Newton's method, LU factorisation kept, without GMRES once corrections are below 5%",
        _convects_steadily,
        petsc="-fluid_ksp_type preonly",
    ),
    "loose": Solver("iterations end at a thousand times the tolerance", _iterates, looser=1e3),
    "umfpack": Solver(
        "LU factorisation by UMFPACK", _always, petsc="-fluid_pc_factor_mat_solver_type umfpack"
    ),
    "superlu": Solver(
        "LU factorisation by SuperLU", _always, petsc="-fluid_pc_factor_mat_solver_type superlu"
    ),
    "stabilised": Solver("with grad-div stabilisation", _convects, {"stabilisation": "on"}),
    "unstabilised": Solver("without stabilisation", _convects, {"stabilisation": "off"}),
    "printed": Solver("convection as in the paper", _laminar_in_time, {"form": "printed"}),
    "energy-stable": Solver("convection that creates no energy", _laminar_in_time, {"form": "energy-stable"}),
    "naive": Solver("grain and fluid by turns", _has_free_body, {"coupling": "naive"}),
}
USUAL_STEADY = ("chords", "loose", "umfpack", "stabilised", "unstabilised")
USUAL_IN_TIME = ("implicit", "extrapolated", "bdf1", "bdf2", "loose")


def usual(scene: Scene) -> tuple[str, ...]:
    """The ways worth comparing with a scene's own. Not collective."""
    words = USUAL_STEADY if scene.time is None else USUAL_IN_TIME
    return tuple(word for word in words if word in others(scene) and (word != "umfpack" or _has_umfpack()))


def others(scene: Scene) -> tuple[str, ...]:
    """The words that change how a scene is solved. Not collective."""
    plan = make_plan(scene)
    return tuple(
        word for word, one in WORDS.items() if one.applies(scene, plan) and not one.is_own(scene, plan)
    )


def named(scene: Scene, asked: Sequence[str]) -> tuple[str, ...]:
    """The ways asked for, each once, without what the scene does anyway on whatever mesh.

    Raises:
        SceneError: a word is not known, means nothing for the scene, or contradicts another.
    """
    ways = ("+".join(_words(scene, name)) for name in asked if name != OWN)
    return tuple(dict.fromkeys(way for way in ways if way))


def _words(scene: Scene, name: str) -> Iterator[str]:
    """The words of a way in the order of `WORDS`, without those of what the scene does anyway."""
    words, able = name.split("+"), others(scene)
    plan, settled = make_plan(scene), set[str]()
    for word in words:
        one = WORDS.get(word)
        if one is None or not one.applies(scene, plan):
            why = "is not known" if one is None else "changes nothing in this scene"
            raise SceneError(f"--solvers: {word} {why}; give some of: {', '.join((OWN, *able))}")
        keys = {option.split()[0] for option in [one.petsc] if option}
        keys |= {key for section in one.sections(scene).values() for key in section}
        if keys & settled:
            raise SceneError(f"--solvers: {name} contradicts itself; join words for different settings only")
        settled |= keys
    # Whether a scene is stabilised may hang on its cells.
    kept = {*able, *(word for word in words if "stabilisation" in WORDS[word].numerics)}
    yield from (word for word in WORDS if word in words and word in kept)


def differs(way: str, scene: Scene) -> bool:
    """Whether a solver option is another than the scene's own. Not collective."""
    return bool(set(way.split("+")) & set(others(scene)))


def sections(way: str, scene: Scene) -> Sections:
    """What a way changes in a scene: keys by section."""
    merged: Sections = {}
    for one in _solvers(way):
        for name, keys in one.sections(scene).items():
            merged[name] = merged.get(name, {}) | keys
    return merged


def options(way: str) -> str:
    """The options of PETSc that a way calls for."""
    return " ".join(one.petsc for one in _solvers(way) if one.petsc)


def said(way: str) -> str:
    """A way in words."""
    return ", ".join(one.said for one in _solvers(way))


def settings(way: str, scene: Scene) -> list[str]:
    """How a user chooses a way: keys of the scene, and the environment."""
    changed = sections(way, scene)
    keys = [f"{name}.{key} = {_toml(value)}" for name in changed for key, value in changed[name].items()]
    return [*keys, *([f'PETSC_OPTIONS="{options(way)}"'] if options(way) else [])]


def own(scene: Scene) -> str:
    """The scene's own way in words."""
    plan = make_plan(scene)
    solved = f"{plan.scheme}, {plan.convection} convection"
    if scene.time is None:
        solved = (
            "Newton's method, LU factorisation kept for GMRES"
            if plan.has(EffectName.INERTIA)
            else "one linear system"
        )
    return f"{solved}, stabilised" if plan.stabilisation.present else solved


def _solvers(way: str) -> list[Solver]:
    return [WORDS[word] for word in way.split("+") if word]


def _toml(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"


def _has_umfpack() -> bool:
    from ..compat import PETSc

    # Debian's name for the collection that UMFPACK is part of; builds differ in which of them they list.
    return any(PETSc.Sys.hasExternalPackage(name) for name in ("suitesparse", "umfpack"))
