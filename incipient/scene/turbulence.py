"""The section [turbulence]."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .section import NotNegative, Positive, Rule, Section, key, rises

Row = Annotated[tuple[float, ...], Field(strict=False, min_length=2, max_length=3)]
OF_INFLOW = ("intensity", "length")
OF_K_EPSILON = ("c_mu", "c_1", "c_2", "sigma_k", "sigma_epsilon")


class Turbulence(Section):
    """The turbulence model, with effects.turbulence = true."""

    rules = (
        Rule("roughness", lambda s: s.wall == "rough" and not s.roughness,
             'is 0 but wall is "rough"', "give the equivalent sand roughness"),
        Rule("roughness", lambda s: s.wall != "rough" and s.roughness,
             'is {s.roughness:g} but wall is "{s.wall}"', 'set wall = "rough"'),
        Rule("upstream_roughness", lambda s: s.upstream_roughness and s.roughness,
             'is for smooth walls, but wall is "rough"', "leave it out: the inflow developed over these walls"),
        Rule("upstream_roughness", lambda s: s.upstream_roughness and s.inflow == "given",
             'is not read with inflow = "given"', "leave it out"),
        Rule("{v}", lambda s: [k for k in OF_INFLOW if s.inflow == "developed" and getattr(s, k) is not None],
             'is read only with inflow = "given" or "profile"', "leave it out"),
        Rule("{v}", lambda s: [k for k in OF_INFLOW if s.inflow != "developed" and getattr(s, k) is None],
             'is missing, which inflow = "{s.inflow}" needs', "add it"),
        Rule("profile", lambda s: s.profile and s.inflow != "profile",
             'is read only with inflow = "profile"', "leave it out"),
        Rule("profile", lambda s: s.inflow == "profile" and (len(s.profile) < 2 or len(set(map(len, s.profile))) != 1),
             "does not have two or more rows of one length", "give rows of height and speed, each with k or none"),
        Rule("profile", lambda s: s.profile and not rises(((0.0,), *s.profile)),
             "has heights that do not increase from above zero", "sort the rows by height, without walls"),
        Rule("profile", lambda s: any(value <= 0.0 for row in s.profile for value in row[1:]),
             "has a speed or a k that is not positive", "omit walls: the law of the wall holds there"),
        Rule("{v}", lambda s: [k for k in OF_K_EPSILON if not s.has_wall_functions and s.changed(k)],
             'is not read by model = "k-omega-sst"', "leave it out"),
        Rule("c_2", lambda s: not 1.0 < s.c_1 < s.c_2,
             "is {s.c_2:g}", "give 1 < c_1 < c_2: else turbulence does not decay"),
    )  # fmt: skip

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
        "Inflow: developed; uniform, with intensity and length; or a measured profile",
        "developed",
    )
    intensity: Positive | None = key(
        "Turbulence intensity relative to V; with a profile its lower bound [-]",
        None,
        examples=[0.05],
    )
    length: Positive | None = key(
        "Mixing length of the inflow; with a profile its upper bound [length]",
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

    @property
    def has_wall_functions(self) -> bool:
        return self.model == "k-epsilon"

    @property
    def constants(self) -> tuple[float, ...]:
        return self.c_mu, self.c_1, self.c_2, self.sigma_k, self.sigma_epsilon

    def rows_beyond(self, walls: int, depth: float) -> str:
        """Error message for rows of the profile beyond a wall on top, or all outside the depth, or ""."""
        if walls < 2 and self.profile and self.profile[0][0] > depth:
            why = f"has no row within the depth of {depth:.4g}"
            return f"turbulence.profile: {why}; give heights in lengths of the scene"
        if walls < 2 or not self.profile or self.profile[-1][0] < walls * depth:
            return ""
        whole = f"the wall on top is {walls * depth:.4g} above that below"
        return f"turbulence.profile: has a row at {self.profile[-1][0]:g}, {whole}; leave out rows beyond it"
