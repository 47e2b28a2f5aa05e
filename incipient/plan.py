"""From the scene follows the plan: which effects are simulated, which are left out and why, and how finely.

The plan decides what is built. A sub-problem or a term that it does not name is never made: no space, no
compiled form, no unknown.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

from .geometry.curves import Line
from .geometry.grain import Disc
from .scene import Scene

GEOMETRY_ORDER = {2: 2, 3: 3, 4: 3}


@dataclass(frozen=True)
class Effect:
    """One physical effect, whether it is simulated, and the reason."""

    name: str
    present: bool
    reason: str


@dataclass(frozen=True)
class Estimate:
    """What the computation will need, counted on the mesh that will be used."""

    cells: int
    unknowns: int
    memory_mib: float


@dataclass(frozen=True)
class Plan:
    """Effects, discretisation and (where it has been counted) expense of a scene's computation."""

    effects: tuple[Effect, ...]
    order: int
    geometry_order: int
    mesh_size: float
    convection: str
    scheme: str
    reynolds: float
    estimate: Estimate | None = None

    def has(self, name: str) -> bool:
        """Whether an effect is simulated."""
        return any(effect.present for effect in self.effects if effect.name == name)

    def with_estimate(self, estimate: Estimate) -> Plan:
        """The same plan with its expense counted."""
        return replace(self, estimate=estimate)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for result.json."""
        return asdict(self)

    def text(self) -> str:
        """The plan as a few lines for a reader."""
        lines = [f"  {'yes' if e.present else ' no'}  {e.name}: {e.reason}" for e in self.effects]
        lines.append(
            f"  P{self.order}-P{self.order - 1} Taylor-Hood on cells of order {self.geometry_order}, "
            f"cell sizes x {self.mesh_size:g}, {self.scheme}, {self.convection} convection"
        )
        if self.estimate is not None:
            e = self.estimate
            lines.append(f"  {e.cells} cells, {e.unknowns} unknowns, about {e.memory_mib:.0f} MiB of memory")
        return "\n".join(lines)


def make_plan(scene: Scene) -> Plan:
    """Decide from the scene alone; nothing is meshed or computed. Not collective."""
    time, numerics = scene.time, scene.numerics
    effects = tuple(_effects(scene))
    return Plan(
        effects=effects,
        order=numerics.order,
        geometry_order=_geometry_order(scene),
        mesh_size=numerics.mesh_size,
        convection=_convection(scene),
        scheme=time.scheme if time else "steady",
        reynolds=1.0 / scene.viscosity,
    )


def _effects(scene: Scene) -> list[Effect]:
    body, time, gravity = scene.body, scene.time, scene.gravity
    contact = body is not None and scene.bed is not None and body.x is not None
    moving = scene.flow.kind != "still"
    absent = "not part of this version"
    return [
        Effect("inertia", *_inertia(scene)),
        Effect("unsteadiness", time is not None, f"until t = {time.end:g}" if time else "no [time] section"),
        Effect("traction", body is not None, "of the fluid on the grain" if body else "no [body] section"),
        Effect("gravity", gravity is not None, _gravity(scene)),
        Effect("contact", contact, "the grain rests on the bed" if contact else "no grain rests on a bed"),
        Effect("flow", moving, f"{scene.flow.kind} flow" if moving else "the fluid is at rest"),
        Effect("moving mesh", _moves(scene), _mesh_motion(scene)),
        Effect("free body", body is not None and body.motion == "free", _motion(scene)),
        Effect("free surface", False, f'the top is "{scene.top}"'),
        Effect("turbulence", False, absent),
        Effect("third dimension", False, "the scene is two-dimensional"),
    ]


def _inertia(scene: Scene) -> tuple[bool, str]:
    if not scene.fluid.inertia:
        return False, "fluid.inertia = false"
    if scene.flow.kind == "still" and not _moves(scene):
        return False, "the fluid is at rest"
    return True, f"Re = {scene.fluid.reynolds:g} on {scene.fluid.scale} scale"


def _moves(scene: Scene) -> bool:
    return scene.body is not None and scene.body.moves


def _mesh_motion(scene: Scene) -> str:
    if not _moves(scene):
        return "nothing moves"
    if isinstance(scene.grain, Disc):
        return "the mesh follows the grain; it need not turn with a disc"
    return "the mesh follows the grain"


def _motion(scene: Scene) -> str:
    if scene.body is None:
        return "no [body] section"
    locked = f" but for {', '.join(scene.body.locked)}" if scene.body.locked else ""
    return f'body.motion = "{scene.body.motion}"{locked}'


def _gravity(scene: Scene) -> str:
    if scene.gravity is None:
        return "no [gravity] section"
    return "weight and buoyancy of the grain; hydrostatic pressure in closed form, no unknowns"


def _geometry_order(scene: Scene) -> int:
    """Straight cells where every boundary is straight, else curved ones to match the velocity."""
    if scene.numerics.geometry_order is not None:
        return scene.numerics.geometry_order
    curves = list(scene.grain.outline()) if scene.grain is not None else []
    if scene.bed_shape is not None:
        curves.extend(scene.bed_shape.curves(scene.domain.left, scene.domain.right))
    return 1 if all(isinstance(curve, Line) for curve in curves) else GEOMETRY_ORDER[scene.numerics.order]


def _convection(scene: Scene) -> str:
    if not _inertia(scene)[0]:
        return "no"
    return scene.numerics.convection if scene.time else "implicit"
