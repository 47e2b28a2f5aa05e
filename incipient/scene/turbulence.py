"""Turbulence by a model of the mean flow: what a user writes about it."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from .section import NotNegative, Positive, Section, key

Row = Annotated[tuple[float, ...], Field(strict=False, min_length=2, max_length=3)]
OF_K_EPSILON = ("c_mu", "c_1", "c_2", "sigma_k", "sigma_epsilon")


class Turbulence(Section):
    """Turbulence by a model of the mean flow, with effects.turbulence = true."""

    model: Literal["k-epsilon", "k-omega-sst"] = key("Model: k-epsilon or k-omega SST", "k-epsilon")
    wall: Literal["equilibrium", "rough"] = key("Law of the wall", "equilibrium")
    roughness: NotNegative = key(
        'Equivalent sand roughness of walls that are "rough"; a grain is smooth [length]',
        0.0,
    )
    upstream_roughness: NotNegative = key(
        "Equivalent sand roughness of the bed upstream, over which the inflow past smooth walls developed [length]",
        0.0,
    )
    wall_distance: Positive | None = key(
        "Distance of walls from the mesh; without it 50 nu/u* with k-epsilon, 0.45 nu/u* with k-omega-sst [length]",
        None,
        examples=[0.05],
    )
    inflow: Literal["developed", "given", "profile"] = key(
        "Inflow: nearly developed; uniform, by intensity and length; or a measured profile",
        "developed",
    )
    intensity: Positive | None = key(
        "Root mean square of a velocity's fluctuation over V; with a profile at least [-]",
        None,
        examples=[0.05],
    )
    length: Positive | None = key(
        "Mixing length of the turbulence that enters; with a profile the largest [length]",
        None,
        examples=[0.1],
    )
    profile: Annotated[tuple[Row, ...], Field(strict=False)] = key(
        "Rows of height above the bed at the inflow [length] and speed over V, and k over V^2 if known",
        (),
        examples=[[[0.1, 0.7], [0.5, 0.85], [1.5, 1.0]]],
    )
    c_mu: Positive = key("nu_t = c_mu k^2/epsilon [-]", 0.09)
    c_1: Positive = key("Production of epsilon [-]", 1.44)
    c_2: Positive = key("Loss of epsilon [-]", 1.92)
    sigma_k: Positive = key("nu_t over the diffusivity of k [-]", 1.0)
    sigma_epsilon: Positive = key("nu_t over the diffusivity of epsilon [-]", 1.3)

    @model_validator(mode="after")
    def _is_consistent(self) -> Turbulence:
        if (self.wall == "rough") != (self.roughness > 0.0):
            remedy = (
                "give the equivalent sand roughness"
                if self.wall == "rough"
                else 'set wall = "rough"'
            )
            raise self.refused(
                "roughness", f'is {self.roughness:g} but wall is "{self.wall}"', remedy
            )
        if self.upstream_roughness and (wrong := self._wrong_upstream()):
            raise self.refused("upstream_roughness", *wrong)
        for name in ("intensity", "length"):
            there = getattr(self, name) is not None
            if there != (self.inflow != "developed"):
                why = 'is read only with inflow = "given" or "profile"'
                if not there:
                    why = f'is missing, which inflow = "{self.inflow}" needs'
                raise self.refused(name, why, "leave it out" if there else "add it")
        if wrong := self._wrong_profile():
            raise self.refused("profile", *wrong)
        if other := self._of_other_model():
            raise self.refused(*other)
        if not 1.0 < self.c_1 < self.c_2:
            raise self.refused(
                "c_2", f"is {self.c_2:g}", "give 1 < c_1 < c_2: else turbulence does not decay"
            )
        return self

    def _wrong_upstream(self) -> tuple[str, str] | None:
        """What contradicts a rough bed upstream, and the remedy; None: nothing."""
        if self.roughness:
            return (
                'is for smooth walls, but wall is "rough"',
                "leave it out: the inflow developed over these walls",
            )
        if self.inflow == "given":
            return 'is not read with inflow = "given"', "leave it out"
        return None

    def _wrong_profile(self) -> tuple[str, str] | None:
        """What is wrong with the profile, and the remedy; None: nothing."""
        if self.inflow != "profile":
            return (
                ('is read only with inflow = "profile"', "leave it out") if self.profile else None
            )
        if len(self.profile) < 2 or len({len(row) for row in self.profile}) != 1:
            return (
                "has not two or more rows of one length",
                "give rows of height and speed, each with k or none",
            )
        if any(high[0] <= low[0] for low, high in pairwise(((0.0,), *self.profile))):
            return (
                "has heights that do not ascend from above zero",
                "sort the rows by height, walls left out",
            )
        if any(value <= 0.0 for row in self.profile for value in row[1:]):
            return (
                "has a speed or a k that is not positive",
                "leave walls out: the law of the wall leads there",
            )
        return None

    def _of_other_model(self) -> tuple[str, str, str] | None:
        """A key that the k-omega model does not read, why, and the remedy; None: there is none."""
        if self.has_wall_functions:
            return None
        usual = Turbulence()
        given = [key for key in OF_K_EPSILON if getattr(self, key) != getattr(usual, key)]
        return (given[0], 'is not read by model = "k-omega-sst"', "leave it out") if given else None

    @property
    def has_wall_functions(self) -> bool:
        """Whether the model feels walls by wall functions, over a layer that the mesh leaves out."""
        return self.model == "k-epsilon"

    @property
    def constants(self) -> tuple[float, ...]:
        """The five constants of the model, c_mu first."""
        return self.c_mu, self.c_1, self.c_2, self.sigma_k, self.sigma_epsilon

    def rows_beyond(self, walls: int, depth: float) -> str:
        """Error message for rows of the profile beyond a wall on top, two depths above the lower one; otherwise empty.

        Below a surface, that no row is in the flow.
        """
        if walls < 2 and self.profile and self.profile[0][0] > depth:
            why = f"has no row within the depth of {depth:.4g}"
            return f"turbulence.profile: {why}; give heights in lengths of the scene"
        if walls < 2 or not self.profile or self.profile[-1][0] < walls * depth:
            return ""
        whole = f"the wall on top is {walls * depth:.4g} above that below"
        return f"turbulence.profile: has a row at {self.profile[-1][0]:g}, {whole}; leave out rows beyond it"
