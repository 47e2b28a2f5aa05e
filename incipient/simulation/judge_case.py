"""Forces and contacts given by hand or by another program: a case in a TOML file, checked like a scene.

Any units that fit together. In the plane vectors have two components, and couples and the moment of inertia are
numbers, couples positive counter-clockwise; in space all have three, and the inertia is three or a matrix.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, PlainValidator, field_validator, model_validator

from ..arrays import Floats, spatial
from ..contact import Contacts, Load
from ..contact.robustness import StandardErrors, probabilities
from ..contact.verdict import judge
from ..files import make_directory, plain, write_json
from ..geometry.placement import Placement
from ..scene.file import read
from ..scene.kinds import Body
from ..scene.messages import Key, Problem, counted, refusal
from ..scene.section import NotNegative, Positive, Section, contradiction

ROUNDING = 1e-3  # of unit vectors and of the grain's size: numbers given by hand are rounded


def _numbers(value: Any) -> Floats:
    """The number, list or matrix that a file gives, or the error that says what is wrong with it."""
    try:
        given = np.array(value)
    except ValueError:
        raise contradiction(
            "has rows of different lengths", "give as many numbers in each"
        ) from None
    if given.dtype.kind not in "iuf":
        raise contradiction("is not made of numbers", "give numbers, as in [0.0, -1.0]")
    if not np.isfinite(given).all():
        raise contradiction("is not finite", "give finite numbers")
    return given.astype(float)


def _vector(value: Any) -> tuple[float, ...]:
    given = _numbers(value)
    if given.shape not in ((2,), (3,)):
        what = "is a number" if given.ndim == 0 else f"has {counted(len(given), 'component')}"
        raise contradiction(what, "give two components, as in [x, y], or three in space")
    return tuple(given.tolist())


def _couple(value: Any) -> float | tuple[float, ...]:
    given = _numbers(value)
    if given.shape not in ((), (3,)):
        raise contradiction("is not a couple", "give a number in the plane, or [x, y, z] in space")
    return float(given) if given.ndim == 0 else tuple(given.tolist())


def _inertia(value: Any) -> float | tuple[Any, ...]:
    given = _numbers(value)
    if given.shape not in ((), (3,), (3, 3)):
        why = "is not a moment of inertia"
        raise contradiction(
            why, "give a number in the plane, [J1, J2, J3] or a 3 x 3 matrix in space"
        )
    matrix = _matrix(given)
    moments = np.linalg.eigvalsh(matrix)
    if not np.allclose(matrix, matrix.T, rtol=1e-6) or moments[0] <= 0.0:
        raise contradiction(
            "is not a symmetric positive matrix", "give moments of inertia greater than zero"
        )
    if moments[2] > (1.0 + ROUNDING) * (moments[0] + moments[1]):
        remedy = "no principal moment of a body exceeds the sum of the other two"
        raise contradiction(f"has principal moments {moments.round(6).tolist()}", remedy)
    if given.ndim == 0:
        return float(given)
    return tuple(tuple(row) if isinstance(row, list) else row for row in given.tolist())


Vector = Annotated[tuple[float, ...], PlainValidator(_vector)]
Vectors = Annotated[tuple[Vector, ...], Field(strict=False)]
Couple = Annotated[float | tuple[float, ...], PlainValidator(_couple)]
Inertia = Annotated[float | tuple[Any, ...], PlainValidator(_inertia)]
Areas = Annotated[tuple[NotNegative, ...], Field(strict=False)]


class CaseLoad(Section):
    """What acts on the grain besides the bed."""

    weight: Vector = Field(
        description="all that acts at the centre of mass besides the flow, such as weight"
    )
    flow_force: Vector = Field(description="force of the flow on the grain")
    flow_couple: Couple = Field(description="couple of the flow about the point `about`")
    centre: Vector | None = Field(None, description="centre of mass; left out where [body] has it")
    about: Vector | None = Field(
        None, description="what flow_couple is about; default: the centre of mass"
    )


class CaseContacts(Section):
    """Where the bed touches the grain."""

    points: Vectors = Field(description="points of contact")
    normals: Vectors = Field(description="unit normals there, OUT of the grain")
    friction: NotNegative = Field(description="coefficient of static friction")
    areas: Areas | None = Field(
        None, description="area of the contact at each point; default: points only"
    )
    convex: bool = Field(
        True, description="the grain is convex: no normal points toward its centre of mass"
    )

    @field_validator("points")
    @classmethod
    def _some(cls, points: tuple[Any, ...]) -> tuple[Any, ...]:
        if not points:
            raise contradiction(
                "there is no contact", "give the points at which the bed touches the grain"
            )
        return points

    @field_validator("normals")
    @classmethod
    def _unit(cls, normals: tuple[Any, ...]) -> tuple[Any, ...]:
        for index, length in enumerate(float(np.linalg.norm(normal)) for normal in normals):
            if length == 0.0:
                raise contradiction(
                    f"normal {index} is zero", "give a unit vector out of the grain"
                )
            if abs(length - 1.0) > ROUNDING:
                raise contradiction(f"normal {index} has length {length:g}", "give unit normals")
        return normals

    @model_validator(mode="after")
    def _one_each(self) -> CaseContacts:
        for name in ("normals", "areas"):
            given = getattr(self, name)
            if given is not None and len(given) != len(self.points):
                why = f"{len(given)} given for {counted(len(self.points), 'point')}"
                raise self.refused(name, why, "give one for each point")
        return self


class CaseGrain(Section):
    """How the grain answers a force that is not balanced."""

    mass: Positive = Field(description="mass of the grain")
    inertia: Inertia = Field(description="moment of inertia about the centre of mass")


class CaseErrors(Section):
    """Standard errors of what the load was measured or computed with."""

    flow_force: Vector | None = Field(
        None, description="standard error of each component of the flow's force"
    )
    flow_couple: Couple | None = Field(None, description="standard error of the flow's couple")
    friction: NotNegative = Field(0.0, description="standard error of the coefficient of friction")
    samples: int = Field(1000, ge=10, le=1_000_000, description="number of cases drawn at random")
    seed: int = Field(
        0, ge=0, description="seed of the random numbers: the same seed gives the same answer"
    )

    @field_validator("flow_force", "flow_couple")
    @classmethod
    def _not_negative(cls, value: Any) -> Any:
        if value is not None and np.min(value) < 0.0:
            raise contradiction(f"is {np.min(value):g}", "a standard error is not negative")
        return value


class Case(Section):
    """A grain in contact with its bed and the load on it."""

    title: str = Field("", description="title of the case")
    source: str = Field("", description="where the numbers come from")
    load: CaseLoad = Field(description="what acts on the grain besides the bed")
    contacts: CaseContacts = Field(description="where the bed touches the grain")
    grain: CaseGrain | None = Field(None, description="mass and inertia, for how it begins to move")
    body: Body | None = Field(
        None, description="the grain's shape as in a scene, instead of [grain]"
    )
    errors: CaseErrors | None = Field(
        None, description="standard errors, for the probability of each mode"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Case:
        problem = next((found for check in _CHECKS for found in check(self)), None)
        if problem is not None:
            raise refusal("Case", [problem], between=True)
        return self

    @property
    def gdim(self) -> int:
        """2 in the plane, 3 in space."""
        return len(self.load.weight)

    @property
    def centre(self) -> Floats:
        """The centre of mass, (3,)."""
        if self.load.centre is not None:
            return spatial(self.load.centre)
        assert self.body is not None and self.body.centre is not None
        return spatial(self.body.centre)

    @property
    def about(self) -> Floats:
        """The point that the flow's couple is about, (3,)."""
        return self.centre if self.load.about is None else spatial(self.load.about)

    @property
    def placement(self) -> Placement:
        """Where the body is; for a case that has one."""
        assert self.body is not None
        return self.body.placed(self.centre[: self.gdim].tolist())

    def to_load(self) -> Load:
        """The load, its couple carried over to the centre of mass: tau_c = tau_a + (a - c) ^ F."""
        force = spatial(self.load.flow_force)
        couple = spatial_couple(self.load.flow_couple) + np.cross(self.about - self.centre, force)
        return Load(force, couple, spatial(self.load.weight), self.centre)

    def to_contacts(self) -> Contacts:
        """The contacts; normals rounded by hand are made unit vectors."""
        normals = np.array([spatial(n) for n in self.contacts.normals])
        points = np.array([spatial(p) for p in self.contacts.points])
        areas = None if self.contacts.areas is None else np.array(self.contacts.areas)
        return Contacts(points, normals / np.linalg.norm(normals, axis=1)[:, None], areas)

    def standard_errors(self) -> StandardErrors:
        """The standard errors, zero where the case gives none."""
        given = self.errors or CaseErrors()
        force, couple = given.flow_force or (0.0, 0.0, 0.0), given.flow_couple or 0.0
        return StandardErrors(spatial(force), spatial_couple(couple), given.friction, self.about)

    def mass_and_inertia(self) -> tuple[float, Floats] | None:
        """Mass and matrix of inertia (3, 3) about the centre of mass, if the case gives them."""
        if self.grain is not None:
            return self.grain.mass, _matrix(np.array(self.grain.inertia))
        if self.body is None:
            return None
        from ..evaluation.contact_verdict import mass_and_inertia

        return mass_and_inertia(self.body, self.placement)


def load_case(path: Path | str, overrides: Sequence[str] = ()) -> Case:
    """The case in a TOML file, changed by overrides such as ``"contacts.friction=0.4"``. Not collective.

    Raises:
        SceneError: one line that names the file, the key, why and the remedy.
    """
    return read(Case, path, overrides)


def judge_case(case: Case) -> dict[str, Any]:
    """Both judges' verdict on a case as plain data; the probability of each mode where it gives errors."""
    acting, contacts, friction = case.to_load(), case.to_contacts(), case.contacts.friction
    inert = case.mass_and_inertia()
    verdict = judge(acting, contacts, friction, inert)
    said = {
        "title": case.title,
        "source": case.source,
        "verdict": verdict.to_dict(),
        "probabilities": None,
    }
    said["case"] = case.model_dump(mode="json", exclude_none=True, warnings=False)
    if case.errors is not None:
        drawn = case.errors.samples, case.errors.seed
        chances = probabilities(acting, contacts, friction, case.standard_errors(), *drawn, inert)
        said["probabilities"] = {"sentence": chances.sentence, **plain(chances)}
    return said


def save(judgement: dict[str, Any], directory: Path) -> None:
    """Write judgement.json into a directory, which is made if need be; raises OutputError. Not collective."""
    path = directory / "judgement.json"
    make_directory(directory, path)
    write_json(path, judgement)


def text(case: Case, judgement: dict[str, Any]) -> str:
    """The judgement of a case in a few sentences for a reader."""
    verdict, chances = judgement["verdict"], judgement["probabilities"]
    lines = [case.title] if case.title else []
    lines += [f"{part[0].upper()}{part[1:]}." for part in verdict["sentence"].split("; ", 1)]
    if chances is not None:
        said = (chances["sentence"], chances["within"]["sentence"])
        lines += [f"{sentence[0].upper()}{sentence[1:]}." for sentence in said]
    return "\n".join(lines)


def spatial_couple(couple: float | Sequence[float]) -> Floats:
    """A couple of the plane along the third axis; one of space as it is."""
    return np.array([0.0, 0.0, couple] if isinstance(couple, float) else couple, dtype=float)


def _matrix(inertia: Floats) -> Floats:
    return np.asarray(inertia * np.eye(3) if inertia.ndim < 2 else inertia, dtype=float)


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
    given = None if body is None else spatial(body.centre or ())
    if given is not None and centre is not None and not np.allclose(given, spatial(centre)):
        yield Problem(("load", "centre"), "is not body.centre", "leave one out")


def _one_dimension(case: Case) -> Iterator[Problem]:
    for key, vector in _vectors(case):
        if len(vector) != case.gdim:
            why = f"has {len(vector)} components, load.weight has {case.gdim}"
            yield Problem(key, why, "give two everywhere, or three everywhere")
    couples: list[tuple[Key, Any]] = [(("load", "flow_couple"), case.load.flow_couple)]
    if case.errors is not None:
        couples.append((("errors", "flow_couple"), case.errors.flow_couple))
    if case.grain is not None:
        couples.append((("grain", "inertia"), case.grain.inertia))
    for key, given in couples:
        if given is not None and isinstance(given, float) != (case.gdim == 2):
            remedy = "give one number" if case.gdim == 2 else "give three components"
            yield Problem(key, f"does not fit vectors of {case.gdim} components", remedy)
    if case.body is not None and case.body.grain().gdim != case.gdim:
        yield Problem(
            ("body", "shape"), f"does not fit vectors of {case.gdim} components", "use [grain]"
        )


def _vectors(case: Case) -> Iterator[tuple[Key, tuple[float, ...]]]:
    for name in ("flow_force", "centre", "about"):
        if getattr(case.load, name) is not None:
            yield ("load", name), getattr(case.load, name)
    for name in ("points", "normals"):
        for index, vector in enumerate(getattr(case.contacts, name)):
            yield ("contacts", name, index), vector
    if case.errors is not None and case.errors.flow_force is not None:
        yield ("errors", "flow_force"), case.errors.flow_force


def _outward(case: Case) -> Iterator[Problem]:
    contacts = case.to_contacts()
    arms = contacts.points - case.centre
    lengths = np.linalg.norm(arms, axis=1)
    for index in np.flatnonzero(lengths <= 1e-12 * lengths.max()):
        why = "lies at the centre of mass"
        yield Problem(("contacts", "points", int(index)), why, "give points on the grain's surface")
    cosines = (arms * contacts.normals).sum(axis=1) / np.maximum(lengths, 1e-300)
    for index in np.flatnonzero(cosines < -ROUNDING):
        if case.contacts.convex or (cosines < 0.0).all():
            remedy = "give it pointing out of the grain; if the grain is not convex, convex = false"
            yield Problem(("contacts", "normals", int(index)), "points into the grain", remedy)


def _on_the_grain(case: Case) -> Iterator[Problem]:
    if case.body is None:
        return
    shape, contacts = case.body.grain(), case.to_contacts()
    points = case.placement.to_body(contacts.points[:, : case.gdim])
    for index, level in enumerate(shape.level(points)):
        if abs(level) > ROUNDING * shape.size:
            where = f"lies {abs(level):.3g} {'inside' if level < 0 else 'off'} the grain"
            yield Problem(("contacts", "points", index), where, "give points on its surface")


_CHECKS = (_centre_and_shape, _one_dimension, _outward, _on_the_grain)
