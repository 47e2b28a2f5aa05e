"""Cases: a grain, its contacts and its load as numbers in a TOML file, in any consistent units.

In 2-D torques (positive counter-clockwise) and the moment of inertia are numbers; in 3-D the inertia is three moments
or a matrix.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, PlainValidator

from ..arrays import Floats, Integers, spatial
from ..contact import Contacts, Load
from ..contact.friction import FrictionCone
from ..contact.robustness import StandardErrors, probabilities
from ..contact.verdict import judge
from ..errors import refuse_broken
from ..files import plain
from ..geometry.placement import Placement
from ..scene import Body
from ..scene.file import read
from ..scene.grains import mass_and_inertia
from ..scene.messages import counted, refused
from ..scene.section import NotNegative, Positive, Rule, Section, Title, key

ROUNDING = 1e-3  # of unit vectors and of the grain's size: numbers given by hand are rounded


def _array(what: str, remedy: str, *shapes: tuple[int, ...]) -> PlainValidator:
    def nested_tuples(value: Any) -> Any:
        try:
            array = np.array(value)
        except ValueError:  # rows of different lengths
            array = np.array(None)
        if array.dtype.kind not in "iuf" or array.shape not in shapes:
            raise refused(f"is not {what}", f"give {remedy}")
        if not np.isfinite(array).all():
            raise refused("is not finite", "give finite numbers")
        return _tuples(array.astype(float).tolist())

    return PlainValidator(nested_tuples)


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _unit(normal: tuple[float, ...]) -> tuple[float, ...]:
    if abs((length := np.linalg.norm(normal)) - 1.0) > ROUNDING:
        raise refused(f"has length {length:g}", "give a unit vector out of the grain")
    return normal


def _inert(inertia: Any) -> Any:
    tensor = matrix(inertia)
    moments = np.linalg.eigvalsh(tensor)
    if not np.allclose(tensor, tensor.T, rtol=1e-6) or moments[0] <= 0.0:
        raise refused(
            "is not a symmetric positive matrix", "give moments of inertia greater than zero"
        )
    if moments[2] > (1.0 + ROUNDING) * (moments[0] + moments[1]):
        raise refused(
            f"has principal moments {moments.round(6).tolist()}",
            "no principal moment of a body exceeds the sum of the other two",
        )
    return inertia


def _not_negative(value: Any) -> Any:
    if np.min(value) < 0.0:
        raise refused(f"is {np.min(value):g}", "a standard error is not negative")
    return value


Vector = Annotated[tuple[float, ...], _array("a vector", "[x, y], or [x, y, z] in 3-D", (2,), (3,))]
Torque = Annotated[Any, _array("a torque", "a number, or [x, y, z] in 3-D", (), (3,))]
Inertia = Annotated[
    Any,
    _array("a moment of inertia", "a number, in 3-D three or a 3 x 3 matrix", (), (3,), (3, 3)),
    AfterValidator(_inert),
]
Points = Annotated[tuple[Vector, ...], Field(strict=False, min_length=1)]
Normals = Annotated[tuple[Annotated[Vector, AfterValidator(_unit)], ...], Field(strict=False)]
Areas = Annotated[tuple[NotNegative, ...], Field(strict=False)]
VectorError = Annotated[Vector, AfterValidator(_not_negative)]
TorqueError = Annotated[Torque, AfterValidator(_not_negative)]

# Contacts of a grain: their key, arms (k, 3) about its centre, normals (k, 3) out of it, whether it is convex.
Side = tuple[str, Floats, Floats, bool]
SAME_DIMENSION = "give all for 2-D, or all for 3-D"
OUTWARD = (
    Rule("{v}", lambda s: [f"{where}.points[{index}]" for where, arms, *_ in s.sides
                           for index in _central(arms)],
         "lies at the centre of mass", "give points on the grain's surface"),
    Rule("{v}", lambda s: [f"{where}.normals[{index}]" for where, *side in s.sides for index in _inward(*side)],
         "points into the grain",
         "give it pointing out of the grain; if the grain is not convex, convex = false"),
)  # fmt: skip


def of_other_dimension(vectors: Mapping[str, Any], gdim: int) -> list[tuple[str, int, int]]:
    """Keys of vectors, torques and inertias, or None, that are not for a dimension; theirs, and that."""
    known = {key: value for key, value in vectors.items() if value is not None}
    dimensions = {
        key: 2 if isinstance(value, float) or len(value) == 2 else 3 for key, value in known.items()
    }
    return [(key, other, gdim) for key, other in dimensions.items() if other != gdim]


def _central(arms: Floats) -> Integers:
    lengths = np.linalg.norm(arms, axis=1)
    return np.flatnonzero(lengths <= 1e-12 * lengths.max())


def _inward(arms: Floats, normals: Floats, convex: bool) -> Integers:
    cosines = (arms * normals).sum(axis=1) / np.linalg.norm(arms, axis=1)
    return np.flatnonzero((cosines < -ROUNDING) & (convex or (cosines < 0.0).all()))


class CaseLoad(Section):
    """The load on the grain without the forces of the bed."""

    weight: Vector = key("force at the centre of mass besides that of the flow, such as the weight")
    flow_force: Vector | None = key("force of the flow on the grain", None)
    flow_couple: Torque | None = key("torque of the flow about the point `about`", None)
    centre: Vector | None = key("centre of mass; default: that of [body]", None)
    about: Vector | None = key("reference point of flow_couple; default: the centre of mass", None)

    def about_centre(self, centre: Floats) -> Load:
        """The load; the torque about the centre of mass (3,) is tau_c = tau_a + (a - c) ^ F."""
        force, arm = spatial(self.flow_force or ()), self.reference(centre) - centre
        torque = spatial_torque(self.flow_couple or 0.0) + np.cross(arm, force)
        return Load(force, torque, spatial(self.weight), centre)

    def reference(self, centre: Floats) -> Floats:
        """Reference point (3,) of the torque."""
        return centre if self.about is None else spatial(self.about)


class CaseContacts(Section):
    """Contacts of the grain and the bed."""

    rules = (
        Rule("{v[0]}", lambda s: [
                (name, len(items), counted(len(s.points), "point")) for name in ("normals", "areas")
                if (items := getattr(s, name)) is not None and len(items) != len(s.points)],
             "{v[1]} given for {v[2]}", "give one for each point"),
    )  # fmt: skip

    points: Points = key("points of contact")
    normals: Normals = key("unit normals there, OUT of the grain")
    friction: NotNegative = key("coefficient of static friction")
    cohesion: NotNegative = key(
        "largest tensile force of each contact (coplanar points are one)", 0.0
    )
    areas: Areas | None = key("area of the contact at each point; default: points only", None)
    convex: bool = key("the grain is convex: no normal points toward its centre of mass", True)

    @property
    def law(self) -> FrictionCone:
        return FrictionCone.of(self.friction, self.cohesion)

    def vectors(self, where: str) -> dict[str, Vector]:
        """Points and normals by key, in the section of a name."""
        rows = {name: getattr(self, name) for name in ("points", "normals")}
        return {f"{where}.{name}[{k}]": row for name in rows for k, row in enumerate(rows[name])}

    @property
    def table(self) -> Contacts:
        normals = spatial(self.normals)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        areas = None if self.areas is None else np.array(self.areas)
        return Contacts(spatial(self.points), normals, areas)


class CaseGrain(Section):
    """Inertia of the grain."""

    mass: Positive = key("mass of the grain")
    inertia: Inertia = key("moment of inertia about the centre of mass")


class CaseErrors(Section):
    """Standard errors of the load and of friction."""

    flow_force: VectorError | None = key(
        "standard error of each component of the flow's force", None
    )
    flow_couple: TorqueError | None = key("standard error of the flow's torque", None)
    friction: NotNegative = key("standard error of the coefficient of friction", 0.0)
    samples: int = key("number of cases drawn at random", 1000, ge=10, le=1_000_000)
    seed: int = key("seed of the random numbers", 0, ge=0)


class CaseFile(Section):
    """A file of numbers to judge."""

    title: Title = key("title of the case", "")
    source: str = key("where the numbers come from", "")


class Case(CaseFile):
    """A grain in contact with its bed and the load on it."""

    rules = (
        Rule("body", lambda c: c.body is not None and c.grain is not None,
             "both [body] and [grain] are given", "leave one out"),
        Rule("body.x", lambda c: c.body is not None and c.body.centre is None,
             "a case has no bed to rest the grain on", "give body.centre"),
        Rule("load.centre", lambda c: c.body is None and c.load.centre is None,
             "is missing", "add the centre of mass, at which the weight acts"),
        Rule("load.centre", lambda c: c.body is not None and c.load.centre is not None
             and not np.allclose(spatial(c.body.centre), spatial(c.load.centre)),
             "is not body.centre", "leave one out"),
        Rule("{v[0]}", lambda c: of_other_dimension(c.vectors, c.gdim),
             "is for {v[1]}-D, load.weight has {v[2]} components", SAME_DIMENSION),
        *OUTWARD,
        Rule("contacts.points[{v[0]}]", lambda c: c.body is not None and c.off_surface,
             "lies {v[1]:.3g} {v[2]} the grain", "give points on its surface"),
    )  # fmt: skip

    load: CaseLoad = key("load on the grain without the forces of the bed")
    contacts: CaseContacts = key("contacts of the grain and the bed")
    grain: CaseGrain | None = key("mass and inertia, for the initial acceleration", None)
    body: Body | None = key("the grain's shape as in a scene, instead of [grain]", None)
    errors: CaseErrors | None = key("standard errors, for the probability of each mode", None)

    @property
    def vectors(self) -> dict[str, Any]:
        """Values whose dimension is that of the weight, or None, by key."""
        errors, names = self.errors or CaseErrors(), ("flow_force", "flow_couple")
        return {
            **{f"load.{name}": getattr(self.load, name) for name in (*names, "centre", "about")},
            **{f"errors.{name}": getattr(errors, name) for name in names},
            "grain.inertia": self.grain and self.grain.inertia,
            **self.contacts.vectors("contacts"),
            "body.shape": self.body and (0.0,) * self.body.gdim,
        }

    @property
    def sides(self) -> list[Side]:
        """The contacts, as seen from the grain."""
        table = self.contacts.table
        return [("contacts", table.points - self.centre, table.normals, self.contacts.convex)]

    @property
    def off_surface(self) -> list[tuple[int, float, str]]:
        """Index and distance of the points that are not on the surface of the body, and the side."""
        assert self.body is not None
        shape = self.body.grain
        levels = shape.level(self.placement.to_body(self.contacts.table.points[:, : self.gdim]))
        return [
            (index, abs(level), "inside" if level < 0 else "off")
            for index, level in enumerate(levels.tolist())
            if abs(level) > ROUNDING * shape.size
        ]

    def require_flow(self, source: str) -> None:
        remedy = "is missing; add force and torque of the flow"
        refuse_broken(
            (self.load.flow_force is None, f"{source}: load.flow_force: {remedy}"),
            (self.load.flow_couple is None, f"{source}: load.flow_couple: {remedy}"),
        )

    @property
    def gdim(self) -> int:
        return len(self.load.weight)

    @property
    def centre(self) -> Floats:
        own = None if self.body is None else self.body.centre
        return spatial(self.load.centre or own or ())

    @property
    def placement(self) -> Placement:
        assert self.body is not None
        return self.body.placed(self.centre[: self.gdim].tolist())

    def to_load(self) -> Load:
        return self.load.about_centre(self.centre)

    def mass_and_inertia(self) -> tuple[float, Floats] | None:
        if self.grain is not None:
            return self.grain.mass, matrix(self.grain.inertia)
        return None if self.body is None else mass_and_inertia(self.body, self.placement)


def load_case(path: Path | str, overrides: Sequence[str] = (), needs_flow: bool = True) -> Case:
    """Read a case from a TOML file, changed by overrides such as ``"contacts.friction=0.4"``.

    Raises SceneError, naming the file, the key, the reason and the remedy; `needs_flow`: also without a flow.
    """
    case = read(Case, path, overrides)
    if needs_flow:
        case.require_flow(str(path))
    return case


def judge_case(case: Case) -> dict[str, Any]:
    """Verdict of both criteria as plain data, and mode probabilities of a case with standard errors."""
    load, contacts, law = case.to_load(), case.contacts.table, case.contacts.law
    inert = case.mass_and_inertia()
    probabilities_data = None
    if (errors := case.errors) is not None:
        force, torque = spatial(errors.flow_force or ()), spatial_torque(errors.flow_couple or 0.0)
        about = case.load.reference(case.centre)
        standard = StandardErrors(force, torque, errors.friction, about)
        chances = probabilities(load, contacts, law, standard, errors.samples, errors.seed, inert)
        probabilities_data = {"sentence": chances.sentence, **plain(chances)}
    return {
        "title": case.title,
        "source": case.source,
        "verdict": judge(load, contacts, law, inert).to_dict(),
        "probabilities": probabilities_data,
        "case": case.model_dump(mode="json", exclude_none=True, warnings=False),
    }


def text(judgement: Mapping[str, Any]) -> str:
    """The judgement of a case in a few sentences."""
    chances = judgement["probabilities"]
    sentences = judgement["verdict"]["sentence"].split("; ", 1)
    if chances is not None:
        sentences += [chances["sentence"], chances["within"]["sentence"]]
    lines = [f"{sentence[0].upper()}{sentence[1:]}." for sentence in sentences]
    return "\n".join(filter(None, [judgement["title"], *lines]))


def spatial_torque(torque: float | Sequence[float]) -> Floats:
    """Torque (3,); in 2-D about the third axis."""
    return np.array([0.0, 0.0, torque] if isinstance(torque, float) else torque, dtype=float)


def matrix(inertia: Any) -> Floats:
    """Inertia (3, 3) of one or three moments, or of a matrix."""
    array = np.array(inertia, dtype=float)
    return np.asarray(array * np.eye(3) if array.ndim < 2 else array)
