"""The models of turbulence: what each says of a scene before it is meshed, and the part of a run that it makes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator

from ...errors import SceneError
from ...forms.k_omega_sst import SMOOTHEST_SAND
from ...planning.flow_setup import Setup
from ...planning.meshing_in_space import cut_at_inflow
from ..effect import SlowestFlow
from ..run_part import RunPart
from . import limits

COARSEST = 0.2  # roughness over the depth, the size of a grain and bedforms
HOLDS = 1e-3  # Shields number of a flow that a 3-D search begins with if it holds the grain
# As measured (docs/contribute/defaults.md).
EXPECTED = "a search takes four flows or more, of up to a minute and a half each; above u* d/nu = 100 of four and more"
SLOW = 20.0  # Reynolds number by depth and mean velocity of the flow that a search begins with
# Where a slower flow than the slowest one moves the grain: a threshold cannot be searched below a mean profile.
BY_SWEEP = 'sweep fluid.reynolds below flow.kind = "log-law", without turbulence'
Flow = Callable[..., RunPart]  # of the setup, the domain and the stages of a run


class TurbulenceModel(ABC):
    """A model of turbulence, as the effect asks for it. No method is collective."""

    @abstractmethod
    def text(self, setup: Setup) -> str:
        """What the plan says of the model in a scene."""

    @abstractmethod
    def warnings(self, setup: Setup) -> Iterator[str]:
        """What makes the result less sure; raises SceneError where the model is not for the scene."""

    @abstractmethod
    def flow(self) -> Flow:
        """What makes the unknowns of the model in a run, from its setup, domain and stages."""

    def slowest_flow(self, setup: Setup) -> SlowestFlow | None:
        """The slowest flow that a search for a threshold may begin with; None: any."""
        return None

    def threshold_needs(self, setup: Setup) -> Iterator[str]:
        """No accuracy: the mesh is made for the flow's speed."""
        if setup.scene.numerics.accuracy is not None:
            yield "numerics.accuracy left out with turbulence; see its error bars"


class KEpsilonModel(TurbulenceModel):
    """The k-epsilon model with wall functions."""

    def text(self, setup: Setup) -> str:
        """The walls, and where their law begins."""
        return f"k-epsilon model; {setup.walls.text()}"

    def warnings(self, setup: Setup) -> Iterator[str]:
        """Walls, beds and grains for which the law of the wall is doubtful; those for which it does not hold raise."""
        for why in limits.refusals(setup):
            raise SceneError(why)
        yield from limits.doubts(setup)

    def flow(self) -> Flow:
        """k and epsilon."""
        from .k_epsilon import KEpsilonFlow

        return KEpsilonFlow

    def slowest_flow(self, setup: Setup) -> SlowestFlow | None:
        """The slowest flow in which the law of the wall is for grain and depth."""
        return SlowestFlow(limits.slowest(setup), "that the law of the wall is for", BY_SWEEP)


class KOmegaModel(TurbulenceModel):
    """The k-omega SST model, to walls that the mesh resolves."""

    def text(self, setup: Setup) -> str:
        """The walls, and how finely they are resolved."""
        return f"k-omega SST model; {setup.resolved_walls.text()}"

    def warnings(self, setup: Setup) -> Iterator[str]:
        """Warn of flows that are laminar by the model and of a small roughness; a large roughness raises."""
        walls = setup.resolved_walls
        for name, size in (("roughness", walls.roughness), ("upstream_roughness", walls.upstream)):
            if (share := size / walls.depth) > COARSEST:
                raise SceneError(
                    f"turbulence.{name}: is {size:g}, {limits.percent(share)} of the depth, at most "
                    f"{limits.percent(COARSEST)}; use a smaller one"
                )
        if 0.0 < walls.sand < SMOOTHEST_SAND:
            yield (
                f"turbulence.roughness: u* k_s/nu is about {walls.sand:.2g}, hydraulically smooth: walls are as if it "
                f'were {SMOOTHEST_SAND:g}; leave wall = "rough" out'
            )
        yield from _of_sand_on_forms(setup)
        yield from _of_sand_below_grain(setup)
        yield from _of_forms_beyond(setup)
        if walls.is_laminar:
            re_tau = walls.depth / walls.unit
            yield (
                f"the inflow is laminar by the k-omega model, u* h/nu = {re_tau:.3g}: it decays to "
                "nothing there, and loads are those of laminar flow"
            )

    def flow(self) -> Flow:
        """k and omega."""
        from .k_omega_flow import KOmegaFlow

        return KOmegaFlow

    def slowest_flow(self, setup: Setup) -> SlowestFlow | None:
        """A slow laminar flow; in 3-D, where flows take minutes, a search begins at a low Shields number."""
        walls = setup.resolved_walls
        slowest = SLOW * walls.viscosity / (walls.mean * walls.depth)
        start, expected = 0.0, ""
        if setup.geometry.gdim == 3:
            start, expected = (HOLDS * setup.stress_unit / setup.bed_stress()) ** 0.5, EXPECTED
        return SlowestFlow(slowest, "looked at", BY_SWEEP, start, expected)


def _of_sand_on_forms(setup: Setup) -> Iterator[str]:
    """Warn where the roughness is not small compared with bedforms."""
    sand, bed, domain = setup.resolved_walls.roughness, setup.geometry.bed, setup.geometry.domain
    if bed is None or sand <= COARSEST * bed.feature:
        return
    if setup.geometry.gdim == 3 or not len(bed.corners(domain.left, domain.right)):
        yield (
            f"the roughness of the bed, {sand:.3g}, is {limits.percent(sand / bed.feature)} of the smallest length of "
            f"its forms, {bed.feature:.3g}: the model assumes that it is small compared with them, as it is up to "
            f"{limits.percent(COARSEST)}"
        )


def _of_sand_below_grain(setup: Setup) -> Iterator[str]:
    """Warn where the bed's roughness is as high as the gap below the grain; one too high for the grain raises."""
    walls, grain = setup.resolved_walls, setup.geometry.grain
    if grain is None or not walls.roughness:
        return
    if (share := walls.roughness / grain.size) > COARSEST:
        raise SceneError(
            f"turbulence.roughness: is {walls.roughness:g}, {limits.percent(share)} of the grain, at most "
            f"{limits.percent(COARSEST)}: on coarser roughness it does not rest on a planar bed; use a smaller one, or "
            "bedforms next to the grain and turbulence.upstream_roughness"
        )
    if walls.roughness > (gap := setup.geometry.stance.gap):
        yield (
            f"the roughness of the bed, {walls.roughness:.3g}, is higher than the gap below the grain, {gap:.3g}: flow "
            "in the gap is not resolved, since the model assumes a roughness smaller than all meshed lengths"
        )


def _of_forms_beyond(setup: Setup) -> Iterator[str]:
    """Warn where the inflow cuts bedforms."""
    if cut_at_inflow(setup):
        yield (
            "the inflow cuts bedforms, next to which k may diverge, since the inflow profile has developed over "
            "a planar bed: put the grain farther downstream of the inflow"
        )


# Each model by its name in the section [turbulence].
MODELS: dict[str, TurbulenceModel] = {"k-epsilon": KEpsilonModel(), "k-omega-sst": KOmegaModel()}
