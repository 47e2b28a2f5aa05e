"""Solver options of a scene: what a ladder of runs varies besides order, mesh and time step.

An option is named by words joined by "+", such as "extrapolated+bdf1"; the empty name stands for the scene's own.
A word stands for settings that a user can make as well: keys of the scene, or options of PETSc.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from ..effects.plan import make_plan
from ..errors import SceneError
from ..planning.effects import EffectName
from ..planning.plan import Plan
from ..planning.tolerance import of_steady
from ..scene import Scene

OWN = "own"
LOOSEST = 1e-3  # to which a tolerance is enlarged at the most
Sections = dict[str, dict[str, Any]]


@dataclass(frozen=True)
class Solver:
    """A solver option, as the word for it stands in tables.

    said:    in words
    needs:   effects without which it means nothing
    numerics, time: keys of these sections with their values
    petsc:   options of PETSc
    looser:  factor on the tolerances
    laminar, steady: whether it is for such flow alone
    """

    said: str
    needs: tuple[EffectName, ...] = ()
    numerics: Mapping[str, Any] = field(default_factory=dict)
    time: Mapping[str, Any] = field(default_factory=dict)
    petsc: str = ""
    looser: float = 1.0
    laminar: bool = False
    steady: bool = False


CONVECTION, TIME = (EffectName.INERTIA,), (EffectName.UNSTEADINESS,)
BOTH = CONVECTION + TIME
PACKAGE = "-fluid_pc_factor_mat_solver_type"
WORDS = {
    "implicit": Solver(
        "convection iterated in each step", BOTH, {"convection": "implicit"}, laminar=True
    ),
    "extrapolated": Solver(
        "convection linearised about earlier steps",
        BOTH,
        {"convection": "extrapolated"},
        laminar=True,
    ),
    "bdf1": Solver("backward differences of first order", TIME, time={"scheme": "bdf1"}),
    "bdf2": Solver("backward differences of second order", TIME, time={"scheme": "bdf2"}),
    "chords": Solver(
        "Newton's method, LU factorisation kept, without GMRES once corrections are below 5%",
        CONVECTION,
        petsc="-fluid_ksp_type preonly",
        steady=True,
    ),
    "loose": Solver("iterations end at a thousand times the tolerance", looser=1e3),
    "umfpack": Solver("LU factorisation by UMFPACK", petsc=f"{PACKAGE} umfpack"),
    "superlu": Solver("LU factorisation by SuperLU", petsc=f"{PACKAGE} superlu"),
    "stabilised": Solver(
        "with grad-div stabilisation", CONVECTION, {"stabilisation": "on"}, laminar=True
    ),
    "unstabilised": Solver(
        "without stabilisation", CONVECTION, {"stabilisation": "off"}, laminar=True
    ),
}
USUAL_STEADY = ("chords", "loose", "umfpack", "stabilised", "unstabilised")
USUAL_IN_TIME = ("implicit", "extrapolated", "bdf1", "bdf2", "loose")


@dataclass(frozen=True, eq=False)
class SolverOptions:
    """The solver options of a scene, and what they change in it. Methods are not collective."""

    scene: Scene

    @cached_property
    def plan(self) -> Plan:
        """The plan of the scene."""
        return make_plan(self.scene)

    @cached_property
    def others(self) -> tuple[str, ...]:
        """The words that change how the scene is solved."""
        return tuple(
            word for word, one in WORDS.items() if self._applies(one) and not self._is_own(one)
        )

    @property
    def usual(self) -> tuple[str, ...]:
        """The solver options worth comparing with the scene's own."""
        words = USUAL_STEADY if self.scene.time is None else USUAL_IN_TIME
        return tuple(
            word for word in words if word in self.others and (word != "umfpack" or _has_umfpack())
        )

    def named(self, asked: Sequence[str]) -> tuple[str, ...]:
        """The named solver options, each once, without those that the scene has anyway on every mesh.

        Raises:
            SceneError: a word is not known, means nothing for the scene, or contradicts another.
        """
        found = ("+".join(self._words(name)) for name in asked if name != OWN)
        return tuple(dict.fromkeys(solver for solver in found if solver))

    def differs(self, solver: str) -> bool:
        """Whether a solver option is another than the scene's own."""
        return bool(set(solver.split("+")) & set(self.others))

    def sections(self, solver: str) -> Sections:
        """Keys that a solver option changes in the scene, by section."""
        merged: Sections = {}
        for name, keys in (
            part for one in _solvers(solver) for part in self._sections(one).items()
        ):
            merged[name] = merged.get(name, {}) | keys
        return merged

    def settings(self, solver: str) -> list[str]:
        """Settings by which a user chooses a solver option: keys of the scene, and the environment."""
        sections = self.sections(solver).items()
        changed = [
            (f"{name}.{key}", value) for name, keys in sections for key, value in keys.items()
        ]
        keys = [
            f'{key} = "{one}"' if isinstance(one, str) else f"{key} = {one:g}"
            for key, one in changed
        ]
        return [*keys, *([f'PETSC_OPTIONS="{options(solver)}"'] if options(solver) else [])]

    @property
    def own(self) -> str:
        """The solver option of the scene itself, in words."""
        solved = f"{self.plan.scheme}, {self.plan.convection} convection"
        if self.scene.time is None:
            newton = "Newton's method, LU factorisation kept for GMRES"
            solved = newton if self.plan.has(EffectName.INERTIA) else "one linear system"
        return f"{solved}, stabilised" if self.plan.stabilisation.present else solved

    def _words(self, name: str) -> Iterator[str]:
        """The words of a solver option in the order of `WORDS`, without those of what the scene does anyway."""
        words, settled = name.split("+"), set[str]()
        for word in words:
            one = WORDS.get(word)
            if one is None or not self._applies(one):
                why = "is not known" if one is None else "changes nothing in this scene"
                some = ", ".join((OWN, *self.others))
                raise SceneError(f"--solvers: {word} {why}; give some of: {some}")
            keys = {option.split()[0] for option in [one.petsc] if option}
            keys |= {key for section in self._sections(one).values() for key in section}
            if keys & settled:
                remedy = "join words for different settings only"
                raise SceneError(f"--solvers: {name} contradicts itself; {remedy}")
            settled |= keys
        # Whether a scene is stabilised may hang on its cells.
        kept = {*self.others, *(word for word in words if "stabilisation" in WORDS[word].numerics)}
        yield from (word for word in WORDS if word in words and word in kept)

    def _applies(self, one: Solver) -> bool:
        """Whether an option means anything for the scene."""
        scene, has = self.scene, self.plan.has
        iterates = has(EffectName.INERTIA) or scene.time is not None
        excluded = (one.laminar and scene.is_averaged) or (one.steady and scene.time is not None)
        return all(map(has, one.needs)) and not excluded and (iterates or one.looser == 1.0)

    def _is_own(self, one: Solver) -> bool:
        """Whether the scene is solved so anyway."""
        if "stabilisation" in one.numerics:
            return self.plan.stabilisation.present == (one.numerics["stabilisation"] == "on")
        same = (
            getattr(getattr(self.scene, name), key) == value
            for name, keys in self._sections(one).items()
            for key, value in keys.items()
        )
        return not one.petsc and all(same)

    def _sections(self, one: Solver) -> Sections:
        """The keys, by section, that an option changes in the scene."""
        numerics = {**one.numerics, **(self._tolerances(one.looser) if one.looser > 1.0 else {})}
        return {
            name: keys for name, keys in (("numerics", numerics), ("time", dict(one.time))) if keys
        }

    def _tolerances(self, looser: float) -> dict[str, float]:
        """The tolerances that end the iterations, enlarged, by key."""
        scene = self.scene
        moves = scene.has_surface or scene.moves
        names = ("tolerance", "interface_tolerance") if moves else ("tolerance",)
        given = {name: of_steady(getattr(scene.numerics, name)) for name in names}
        return {name: max(value, min(looser * value, LOOSEST)) for name, value in given.items()}


def options(solver: str) -> str:
    """The options of PETSc that a solver option calls for."""
    return " ".join(one.petsc for one in _solvers(solver) if one.petsc)


def said(solver: str) -> str:
    """A solver option in words."""
    return ", ".join(one.said for one in _solvers(solver))


def _solvers(solver: str) -> list[Solver]:
    return [WORDS[word] for word in solver.split("+") if word]


def _has_umfpack() -> bool:
    from ..compat import PETSc

    # Debian's name for the collection that UMFPACK is part of; builds differ in which of them they list.
    return any(PETSc.Sys.hasExternalPackage(name) for name in ("suitesparse", "umfpack"))
