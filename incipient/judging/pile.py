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
from ..contact.verdict import margin
from ..errors import SceneError
from ..files import plain
from ..input_files import read_text
from ..scene.file import read
from ..scene.section import Rule, key
from .case import (
    OUTWARD,
    SAME_DIMENSION,
    CaseContacts,
    CaseFile,
    CaseGrain,
    CaseLoad,
    Side,
    Vector,
    matrix,
    of_other_dimension,
)

BED = "bed"  # in contacts, instead of a grain's name


class PileGrain(CaseGrain, CaseLoad):
    """A grain: its load without the forces of the bed and of other grains, mass and inertia."""

    centre: Vector = key("centre of mass")


class Pile(CaseFile):
    """Grains by name, and the contacts of each with "bed" or other grains."""

    rules = (
        Rule(f"grains.{BED}", lambda p: BED in p.grains,
             "is the name of the bed", "give the grain another name"),
        Rule("contacts.{v[0]}.{v[1]}", lambda p: [
                (grain, other, ", ".join([*p.names, BED])) for grain, other, _ in p.faces
                if grain not in p.names or other not in [*p.names, BED] or grain == other],
             "is not a pair of grains, or of a grain and the bed",
             "write [contacts.GRAIN.OTHER] with OTHER one of {v[2]}"),
        Rule("contacts.{v[0]}.{v[1]}",
             lambda p: [pair for *pair, _ in p.faces if pair[0] in p.contacts.get(pair[1], ())][-1:],
             "are contacts of a pair of grains that has others",
             "add them to [contacts.{v[1]}.{v[0]}], with their normals turned round"),
        Rule("{v[0]}", lambda p: of_other_dimension(p.vectors, len(p.grains[p.names[0]].weight)),
             "is for {v[1]}-D, grains.{s.names[0]}.weight has {v[2]} components", SAME_DIMENSION),
        Rule("grains.{v}", lambda p: [name for name in p.names
             if not any(name in pair for *pair, _ in p.faces)],
             "has no contact", f"add [contacts.{{v}}.{BED}]"),
        *OUTWARD,
    )  # fmt: skip

    grains: Annotated[dict[str, PileGrain], Field(min_length=1)] = key("grains by name")
    contacts: dict[str, dict[str, CaseContacts]] = key(
        "contacts of a grain, normals out of it, with the bed or another grain"
    )

    @property
    def names(self) -> list[str]:
        return [*self.grains]

    @property
    def faces(self) -> Iterator[tuple[str, str, CaseContacts]]:
        for grain, others in self.contacts.items():
            for other, contacts in others.items():
                yield grain, other, contacts

    @property
    def vectors(self) -> dict[str, Any]:
        """Values that have one dimension, or None, by key."""
        names = ("weight", "flow_force", "flow_couple", "centre", "about", "inertia")
        vectors = {
            f"grains.{name}.{item}": getattr(grain, item)
            for name, grain in self.grains.items()
            for item in names
        }
        for grain, other, contacts in self.faces:
            vectors |= contacts.vectors(f"contacts.{grain}.{other}")
        return vectors

    @property
    def sides(self) -> list[Side]:
        """The contacts, as seen from each of their grains."""
        return [
            (
                f"contacts.{grain}.{other}",
                table.points - self.load(name).centre,
                sign * table.normals,
                contacts.convex,
            )
            for grain, other, contacts in self.faces
            for table in [contacts.table]
            for name, sign in ((grain, 1.0), (other, -1.0))
            if name != BED
        ]

    def load(self, name: str) -> Load:
        grain = self.grains[name]
        return grain.about_centre(spatial(grain.centre))

    def judge(self) -> PileVerdict:
        """The verdict, of grains and contacts in the order of the file. Raises as `judge_pile`."""
        places = {name: place for place, name in enumerate(self.names)}
        return judge_pile(
            [*map(self.load, self.names)],
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
    verdict, names = pile.judge(), pile.names
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
        "motion": plain(verdict.motion),
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
