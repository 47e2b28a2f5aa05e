"""Turbulence by the k-epsilon model: what a user writes about it, and what contradicts it elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, model_validator

from .messages import Key, Problem
from .numerics import OF_WALLS
from .section import NotNegative, Positive, Section

if TYPE_CHECKING:
    from .model import Scene

Row = Annotated[tuple[float, ...], Field(strict=False, min_length=2, max_length=3)]
FLOWS = ("poiseuille", "open-channel")
LAMINAR = 'use flow.kind = "log-law", the laminar flow with the mean profile of a turbulent stream'


class Turbulence(Section):
    """Turbulence by the k-epsilon model, with effects.turbulence = true."""

    model: Literal["k-epsilon"] = Field("k-epsilon", description="Model of the turbulence")
    wall: Literal["equilibrium", "rough"] = Field("equilibrium", description="Law of the wall")
    roughness: NotNegative = Field(
        0.0, description='Equivalent sand roughness of walls that are "rough" [length]'
    )
    wall_distance: Positive | None = Field(
        None,
        description="Distance from the walls at which the mesh ends; without it 50 nu/u*, estimated [length]",
        examples=[0.05],
    )
    inflow: Literal["developed", "given", "profile"] = Field(
        "developed",
        description="What enters: nearly developed; uniform, by intensity and length; or a measured profile",
    )
    intensity: Positive | None = Field(
        None,
        description="Root mean square of a velocity's fluctuation over V; with a profile at least [-]",
        examples=[0.05],
    )
    length: Positive | None = Field(
        None,
        description="Mixing length of the turbulence that enters; with a profile the largest [length]",
        examples=[0.1],
    )
    profile: Annotated[tuple[Row, ...], Field(strict=False)] = Field(
        (),
        description="Rows of height above the bed at the inflow [length] and speed over V, and k over V^2 if known",
        examples=[[[0.1, 0.7], [0.5, 0.85], [1.5, 1.0]]],
    )
    c_mu: Positive = Field(0.09, description="nu_t = c_mu k^2/epsilon [-]")
    c_1: Positive = Field(1.44, description="Production of epsilon [-]")
    c_2: Positive = Field(1.92, description="Loss of epsilon [-]")
    sigma_k: Positive = Field(1.0, description="nu_t over the diffusivity of k [-]")
    sigma_epsilon: Positive = Field(1.3, description="nu_t over the diffusivity of epsilon [-]")

    @model_validator(mode="after")
    def _is_consistent(self) -> Turbulence:
        if (self.wall == "rough") != (self.roughness > 0.0):
            remedy = "give the equivalent sand roughness" if self.wall == "rough" else 'set wall = "rough"'
            raise self.refused("roughness", f'is {self.roughness:g} but wall is "{self.wall}"', remedy)
        for key in ("intensity", "length"):
            there = getattr(self, key) is not None
            if there != (self.inflow != "developed"):
                why = 'is read only with inflow = "given" or "profile"'
                if not there:
                    why = f'is missing, which inflow = "{self.inflow}" needs'
                raise self.refused(key, why, "leave it out" if there else "add it")
        if wrong := self._wrong_profile():
            raise self.refused("profile", *wrong)
        if not 1.0 < self.c_1 < self.c_2:
            raise self.refused(
                "c_2", f"is {self.c_2:g}", "give 1 < c_1 < c_2: else turbulence does not decay"
            )
        return self

    def _wrong_profile(self) -> tuple[str, str] | None:
        """What is wrong with the profile, and the remedy; None: nothing."""
        if self.inflow != "profile":
            return ('is read only with inflow = "profile"', "leave it out") if self.profile else None
        if len(self.profile) < 2 or len({len(row) for row in self.profile}) != 1:
            return (
                "has not two or more rows of one length",
                "give rows of height and speed, each with k or none",
            )
        if any(high[0] <= low[0] for low, high in pairwise(((0.0,), *self.profile))):
            return "has heights that do not ascend from above zero", "sort the rows by height, walls left out"
        if any(value <= 0.0 for row in self.profile for value in row[1:]):
            return (
                "has a speed or a k that is not positive",
                "leave walls out: the law of the wall leads there",
            )
        return None

    @property
    def constants(self) -> tuple[float, ...]:
        """The five constants of the model, c_mu first."""
        return self.c_mu, self.c_1, self.c_2, self.sigma_k, self.sigma_epsilon


def is_turbulent(scene: Scene) -> bool:
    """Whether a scene asks for turbulence to be simulated."""
    return scene.effects.turbulence is True


def contradictory(scene: Scene) -> Iterator[Problem]:
    """What keeps a scene from having the turbulence that it asks for."""
    if not is_turbulent(scene):
        if scene.turbulence is not None:
            remedy = "set effects.turbulence = true or leave the section out"
            yield Problem(
                ("turbulence",), "describes turbulence, which effects.turbulence does not ask for", remedy
            )
        return
    for key, why, remedy in (*_of_place(scene), *_of_flow(scene), *_of_time(scene), *_of_accuracy(scene)):
        yield Problem(key, why, remedy)


def _of_place(scene: Scene) -> Iterator[tuple[Key, str, str]]:
    if scene.gdim == 3 and scene.sides == "stream":
        why = '"stream" with turbulence is not simulated by this version'
        yield ("domain", "sides"), why, 'use "wall", or "slip", sides without friction'
    if scene.has_surface:
        why = '"free-surface" with turbulence is not simulated by this version'
        yield ("domain", "top"), why, 'use "auto", a lid without friction'


def _of_flow(scene: Scene) -> Iterator[tuple[Key, str, str]]:
    if scene.flow.kind not in FLOWS:
        why = f'"{scene.flow.kind}" with turbulence is not simulated by this version'
        yield ("flow", "kind"), why, 'use "poiseuille" or "open-channel"'
    elif scene.domain.top == "stream":
        yield ("domain", "top"), '"stream" contradicts turbulence below it', 'use "auto"'
    elif getattr(scene.flow, "datum", "auto") != "auto":
        why = "is not there with turbulence, whose profile starts at the bed's height at the inflow"
        yield ("flow", "datum"), why, "leave it out"
    if not scene.fluid.inertia or scene.effects.inertia is False:
        key = ("fluid", "inertia") if not scene.fluid.inertia else ("effects", "inertia")
        yield key, "is false, but without inertia there is no turbulence", "leave it out"


def _of_time(scene: Scene) -> Iterator[tuple[Key, str, str]]:
    if scene.time is None:
        return
    if scene.time.start == "stokes":
        why = '"stokes" leaves out inertia, without which there is no turbulence'
        yield ("time", "start"), why, 'use "steady" or "rest"'
    if scene.effects.unsteadiness is False:
        yield ("effects", "unsteadiness"), "is false but turbulence in time is unsteady", "leave [time] out"
    if scene.numerics.convection == "extrapolated":
        why = "with turbulence the walls' friction is implicit, and so is convection"
        yield ("numerics", "convection"), why, 'use "implicit"'
    if scene.numerics.form == "energy-stable":
        yield ("numerics", "form"), "is not there with turbulence by this version", 'use "printed"'


def _of_accuracy(scene: Scene) -> Iterator[tuple[Key, str, str]]:
    """What an accuracy cannot be that of, or include, with turbulence."""
    numerics = scene.numerics
    if numerics.accuracy is None:
        return
    if scene.time is not None:
        why = "is not sought of turbulence in time by this version"
        yield ("numerics", "accuracy"), why, "leave it out, and see the error bars, or leave [time] out"
    if scene.body is not None:
        return
    if numerics.accuracy == "verdict":
        yield ("numerics", "accuracy"), '"verdict" is that of a grain but there is none', "give a number"
    if numerics.accuracy_of not in ("auto", OF_WALLS):
        why = f'"{numerics.accuracy_of}" is not there in a turbulent channel without a grain'
        yield ("numerics", "accuracy_of"), why, f'use "{OF_WALLS}"'
    if numerics.accuracy_includes == "all":
        why = '"all" means gap and domain but without a grain both belong to the scene'
        yield ("numerics", "accuracy_includes"), why, "leave it out"
