"""Cases: a grain, its contacts and its load as numbers in a TOML file, in any consistent units.

In 2-D torques (positive counter-clockwise) and the moment of inertia are numbers; in 3-D the inertia is three moments
or a matrix.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, PlainValidator, model_validator

from ..arrays import Floats, spatial
from ..contact import Contacts, Load
from ..contact.friction import FrictionCone
from ..contact.robustness import StandardErrors, probabilities
from ..contact.verdict import judge
from ..files import make_directory, plain, write_json
from ..geometry.placement import Placement
from ..input_files import read_text
from ..scene import Body
from ..scene.file import parse, read
from ..scene.mass import mass_and_inertia
from ..scene.messages import Key, Problem, counted, refusal
from ..scene.section import NotNegative, Positive, Rule, Section, contradiction, key

ROUNDING = 1e-3  # of unit vectors and of the grain's size: numbers given by hand are rounded


def _array(what: str, remedy: str, *shapes: tuple[int, ...]) -> PlainValidator:
    def nested_tuples(value: Any) -> Any:
        try:
            array = np.array(value)
        except ValueError:  # rows of different lengths
            array = np.array(None)
        if array.dtype.kind not in "iuf" or array.shape not in shapes:
            raise contradiction(f"is not {what}", f"give {remedy}")
        if not np.isfinite(array).all():
            raise contradiction("is not finite", "give finite numbers")
        return _tuples(array.astype(float).tolist())

    return PlainValidator(nested_tuples)


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def _unit(normal: tuple[float, ...]) -> tuple[float, ...]:
    if abs((length := np.linalg.norm(normal)) - 1.0) > ROUNDING:
        raise contradiction(f"has length {length:g}", "give a unit vector out of the grain")
    return normal


def _inert(inertia: Any) -> Any:
    matrix = _matrix(inertia)
    moments = np.linalg.eigvalsh(matrix)
    if not np.allclose(matrix, matrix.T, rtol=1e-6) or moments[0] <= 0.0:
        raise contradiction(
            "is not a symmetric positive matrix", "give moments of inertia greater than zero"
        )
    if moments[2] > (1.0 + ROUNDING) * (moments[0] + moments[1]):
        remedy = "no principal moment of a body exceeds the sum of the other two"
        raise contradiction(f"has principal moments {moments.round(6).tolist()}", remedy)
    return inertia


def _not_negative(value: Any) -> Any:
    if np.min(value) < 0.0:
        raise contradiction(f"is {np.min(value):g}", "a standard error is not negative")
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


class CaseLoad(Section):
    """The load on the grain without the forces of the bed."""

    weight: Vector = key("force at the centre of mass besides that of the flow, such as the weight")
    flow_force: Vector = key("force of the flow on the grain")
    flow_couple: Torque = key("torque of the flow about the point `about`")
    centre: Vector | None = key("centre of mass; default: that of [body]", None)
    about: Vector | None = key("reference point of flow_couple; default: the centre of mass", None)


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
    cohesion: NotNegative = key("largest tensile force of each contact, in the unit of force", 0.0)
    areas: Areas | None = key("area of the contact at each point; default: points only", None)
    convex: bool = key("the grain is convex: no normal points toward its centre of mass", True)

    @property
    def law(self) -> FrictionCone:
        return FrictionCone.of(self.friction, self.cohesion)


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


class Case(Section):
    """A grain in contact with its bed and the load on it."""

    title: str = key("title of the case", "")
    source: str = key("where the numbers come from", "")
    load: CaseLoad = key("load on the grain without the forces of the bed")
    contacts: CaseContacts = key("contacts of the grain and the bed")
    grain: CaseGrain | None = key("mass and inertia, for the initial acceleration", None)
    body: Body | None = key("the grain's shape as in a scene, instead of [grain]", None)
    errors: CaseErrors | None = key("standard errors, for the probability of each mode", None)

    @model_validator(mode="after")
    def _consistent(self) -> Case:
        for check in (_centre_and_shape, _dimension, _outward, _on_surface):
            if problem := next(check(self), None):
                raise refusal(problem, between=True)
        return self

    @property
    def gdim(self) -> int:
        return len(self.load.weight)

    @property
    def centre(self) -> Floats:
        own = None if self.body is None else self.body.centre
        return spatial(self.load.centre or own or ())

    @property
    def about(self) -> Floats:
        return self.centre if self.load.about is None else spatial(self.load.about)

    @property
    def placement(self) -> Placement:
        assert self.body is not None
        return self.body.placed(self.centre[: self.gdim].tolist())

    def to_load(self) -> Load:
        """The load; the torque about the centre of mass is tau_c = tau_a + (a - c) ^ F."""
        force = spatial(self.load.flow_force)
        torque = spatial_torque(self.load.flow_couple) + np.cross(self.about - self.centre, force)
        return Load(force, torque, spatial(self.load.weight), self.centre)

    def to_contacts(self) -> Contacts:
        normals, areas = spatial(self.contacts.normals), self.contacts.areas
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        points = spatial(self.contacts.points)
        return Contacts(points, normals, None if areas is None else np.array(areas))

    def standard_errors(self) -> StandardErrors:
        errors = self.errors or CaseErrors()
        force, torque = errors.flow_force or (0.0, 0.0, 0.0), errors.flow_couple or 0.0
        return StandardErrors(spatial(force), spatial_torque(torque), errors.friction, self.about)

    def mass_and_inertia(self) -> tuple[float, Floats] | None:
        if self.grain is not None:
            return self.grain.mass, _matrix(self.grain.inertia)
        return None if self.body is None else mass_and_inertia(self.body, self.placement)


class _CaseWithoutFlow(Case):
    @model_validator(mode="before")
    @classmethod
    def _still(cls, data: Any) -> Any:
        load = data.get("load")
        if not isinstance(load, dict):
            return data
        weight = load.get("weight")
        in_3d = isinstance(weight, list) and len(weight) == 3
        zero = {
            "flow_force": [0.0] * (3 if in_3d else 2),
            "flow_couple": [0.0] * 3 if in_3d else 0.0,
        }
        return {**data, "load": {**zero, **load}}


def load_case(path: Path | str, overrides: Sequence[str] = ()) -> Case:
    """Read a case from a TOML file, changed by overrides such as ``"contacts.friction=0.4"``.

    Raises SceneError, naming the file, the key, the reason and the remedy.
    """
    return read(Case, path, overrides)


def load_case_without_flow(path: Path, overrides: Sequence[str] = ()) -> Case:
    """As `load_case`, with force and torque of the flow zero unless given."""
    text = read_text(path, "give the name of a case file")
    return parse(_CaseWithoutFlow, text, path.parent, overrides, str(path))


def judge_case(case: Case) -> dict[str, Any]:
    """Verdict of both criteria as plain data, and mode probabilities of a case with standard errors."""
    load, contacts, law = case.to_load(), case.to_contacts(), case.contacts.law
    inert = case.mass_and_inertia()
    probabilities_data = None
    if case.errors is not None:
        drawn = case.errors.samples, case.errors.seed
        chances = probabilities(load, contacts, law, case.standard_errors(), *drawn, inert)
        probabilities_data = {"sentence": chances.sentence, **plain(chances)}
    return {
        "title": case.title,
        "source": case.source,
        "verdict": judge(load, contacts, law, inert).to_dict(),
        "probabilities": probabilities_data,
        "case": case.model_dump(mode="json", exclude_none=True, warnings=False),
    }


def save(judgement: dict[str, Any], directory: Path) -> None:
    """Write judgement.json into a directory, created if missing. Raises OutputError."""
    path = directory / "judgement.json"
    make_directory(directory, path)
    write_json(path, judgement)


def text(case: Case, judgement: dict[str, Any]) -> str:
    """The judgement of a case in a few sentences."""
    chances = judgement["probabilities"]
    sentences = judgement["verdict"]["sentence"].split("; ", 1)
    if chances is not None:
        sentences += [chances["sentence"], chances["within"]["sentence"]]
    lines = [f"{sentence[0].upper()}{sentence[1:]}." for sentence in sentences]
    return "\n".join([case.title, *lines] if case.title else lines)


def spatial_torque(torque: float | Sequence[float]) -> Floats:
    """Torque (3,); in 2-D about the third axis."""
    return np.array([0.0, 0.0, torque] if isinstance(torque, float) else torque, dtype=float)


def _matrix(inertia: Any) -> Floats:
    array = np.array(inertia, dtype=float)
    return np.asarray(array * np.eye(3) if array.ndim < 2 else array)


def _centre_and_shape(case: Case) -> Iterator[Problem]:
    body, centre = case.body, case.load.centre
    if body is not None and case.grain is not None:
        yield Problem(("body",), "both [body] and [grain] are given", "leave one out")
    if body is not None and body.centre is None:
        yield Problem(("body", "x"), "a case has no bed to rest the grain on", "give body.centre")
    if body is None and centre is None:
        yield Problem(
            ("load", "centre"), "is missing", "add the centre of mass, at which the weight acts"
        )
    own = None if body is None else body.centre
    if own is not None and centre is not None and not np.allclose(spatial(own), spatial(centre)):
        yield Problem(("load", "centre"), "is not body.centre", "leave one out")


def _dimension(case: Case) -> Iterator[Problem]:
    load, errors = case.load, case.errors or CaseErrors()
    values: dict[Key, Any] = {
        ("load", "flow_force"): load.flow_force,
        ("load", "flow_couple"): load.flow_couple,
        ("load", "centre"): load.centre,
        ("load", "about"): load.about,
        ("errors", "flow_force"): errors.flow_force,
        ("errors", "flow_couple"): errors.flow_couple,
        ("grain", "inertia"): case.grain and case.grain.inertia,
    }
    for name in ("points", "normals"):
        listed = enumerate(getattr(case.contacts, name))
        values |= {("contacts", name, index): vector for index, vector in listed}
    dimensions = {
        where: 2 if isinstance(value, float) or len(value) == 2 else 3
        for where, value in values.items()
        if value is not None
    }
    if case.body is not None:
        dimensions["body", "shape"] = case.body.gdim
    for where, dimension in dimensions.items():
        if dimension != case.gdim:
            why = f"is for {dimension}-D, load.weight has {case.gdim} components"
            yield Problem(where, why, "give all for 2-D, or all for 3-D")


def _outward(case: Case) -> Iterator[Problem]:
    contacts = case.to_contacts()
    arms = contacts.points - case.centre
    lengths = np.linalg.norm(arms, axis=1)
    cosines = (arms * contacts.normals).sum(axis=1) / np.maximum(lengths, 1e-300)
    for index in range(len(arms)):
        if lengths[index] <= 1e-12 * lengths.max():
            where, why = ("contacts", "points", index), "lies at the centre of mass"
            yield Problem(where, why, "give points on the grain's surface")
        inward = cosines[index] < -ROUNDING
        if inward and (case.contacts.convex or (cosines < 0.0).all()):
            remedy = "give it pointing out of the grain; if the grain is not convex, convex = false"
            yield Problem(("contacts", "normals", index), "points into the grain", remedy)


def _on_surface(case: Case) -> Iterator[Problem]:
    if case.body is None:
        return
    shape, contacts = case.body.grain, case.to_contacts()
    points = case.placement.to_body(contacts.points[:, : case.gdim])
    for index, level in enumerate(shape.level(points)):
        if abs(level) > ROUNDING * shape.size:
            why = f"lies {abs(level):.3g} {'inside' if level < 0 else 'off'} the grain"
            yield Problem(("contacts", "points", index), why, "give points on its surface")
