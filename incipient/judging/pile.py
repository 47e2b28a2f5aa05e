"""Cases of several grains, on a bed and on one another, as numbers in a TOML file like those of one grain."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from ..arrays import spatial
from ..contact import Load
from ..contact.pile import Interface, PileVerdict, judge_pile
from ..contact.problem import plain
from ..contact.verdict import margin
from ..errors import SceneError
from ..input_files import read_text
from ..scene.file import read
from ..scene.messages import Key, Problem
from ..scene.section import key
from .case import (
    CaseContacts,
    CaseFile,
    CaseGrain,
    CaseLoad,
    Vector,
    matrix,
    not_outward,
    wrong_dimensions,
)

BED = "bed"  # in contacts, instead of a grain's name


class PileGrain(CaseGrain, CaseLoad):
    """A grain: its load without the forces of the bed and of other grains, mass and inertia."""

    centre: Vector = key("centre of mass")


class Pile(CaseFile):
    """Grains by name, and the contacts of each with "bed" or other grains."""

    grains: Annotated[dict[str, PileGrain], Field(min_length=1)] = key("grains by name")
    contacts: dict[str, dict[str, CaseContacts]] = key(
        "contacts of a grain, normals out of it, with the bed or another grain"
    )

    @property
    def faces(self) -> Iterator[tuple[str, str, CaseContacts]]:
        for grain, others in self.contacts.items():
            for other, contacts in others.items():
                yield grain, other, contacts

    def problems(self) -> Iterator[Problem]:
        """Wrong pairs, dimensions and normals; grains without contacts."""
        known, pairs = [*self.grains, BED], set[tuple[str, str]]()
        values: dict[Key, Any] = {}
        if BED in self.grains:
            yield Problem(("grains", BED), "is the name of the bed", "give the grain another name")
        for name, section in self.grains.items():
            names = ("weight", "flow_force", "flow_couple", "centre", "about", "inertia")
            values |= {("grains", name, item): getattr(section, item) for item in names}
        for grain, other, contacts in self.faces:
            where: Key = ("contacts", grain, other)
            if grain not in self.grains or other not in known or grain == other:
                yield Problem(
                    where,
                    "is not a pair of grains, or of a grain and the bed",
                    f"write [contacts.GRAIN.OTHER] with OTHER one of {', '.join(known)}",
                )
            if (other, grain) in pairs:
                yield Problem(
                    where,
                    "are contacts of a pair of grains that has others",
                    f"add them to [contacts.{other}.{grain}], with their normals turned round",
                )
            pairs.add((grain, other))
            for item in ("points", "normals"):
                for place, row in enumerate(getattr(contacts, item)):
                    values[*where, item, place] = row
        first = known[0]
        yield from wrong_dimensions(
            values, len(self.grains[first].weight), f"grains.{first}.weight"
        )
        for name in self.grains:
            if not any(name in pair for pair in pairs):
                yield Problem(("grains", name), "has no contact", f"add [contacts.{name}.{BED}]")
        # Of vectors of one dimension.
        for grain, other, contacts in self.faces:
            table = contacts.table
            for name, side in ((grain, 1.0), (other, -1.0)):
                if name != BED:
                    arms, normals = table.points - self.load(name).centre, side * table.normals
                    yield from not_outward(
                        ("contacts", grain, other), arms, normals, contacts.convex
                    )

    def load(self, name: str) -> Load:
        grain = self.grains[name]
        return grain.about_centre(spatial(grain.centre))

    def judge(self) -> PileVerdict:
        """The verdict, of grains and contacts in the order of the file. Raises as `judge_pile`."""
        places = {name: place for place, name in enumerate(self.grains)}
        return judge_pile(
            [self.load(name) for name in self.grains],
            [
                Interface(places[grain], places.get(other), contacts.table, contacts.law)
                for grain, other, contacts in self.faces
            ],
            [grain.mass for grain in self.grains.values()],
            [matrix(grain.inertia) for grain in self.grains.values()],
        )


def is_pile(path: Path) -> bool:
    """Whether a case file has several grains; False if it cannot be read."""
    with suppress(SceneError, ValueError, RecursionError):
        return "grains" in tomllib.loads(read_text(path, ""))
    return False


def judge_pile_case(path: Path, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Verdict of a case file of several grains as plain data; raises as `load_case`."""
    pile = read(Pile, path, overrides)
    verdict, names = pile.judge(), [*pile.grains]
    motion = None if verdict.motion is None else plain(verdict.motion)
    pairs = [[grain, other] for grain, other, table in pile.faces for _ in table.points]
    return {
        "title": pile.title,
        "source": pile.source,
        "sentences": _sentences(verdict, names),
        "moves": verdict.moves,
        "safety_factor": plain(verdict.safety.value),
        "first": [names[place] for place in verdict.first],
        "grains": names,
        "pairs": pairs,
        "safety": plain(verdict.safety),
        "motion": motion,
        "unsolved": verdict.unsolved,
        "case": pile.model_dump(mode="json", exclude_none=True, warnings=False),
    }


def _sentences(verdict: PileVerdict, names: Sequence[str]) -> list[str]:
    whole = "a grain begins to move" if verdict.moves else "each grain stays at rest"
    sentences = [f"{whole}, {margin(verdict.safety)}"]
    if verdict.motion is not None:
        ways = ", ".join(map(": ".join, zip(names, verdict.motion.modes, strict=True)))
        sentences.append(f"motion under {verdict.motion.factor:.4g} times the flow's load: {ways}")
    if verdict.unsolved:
        sentences.append(verdict.unsolved)
    return [f"{sentence[0].upper()}{sentence[1:]}." for sentence in sentences]
