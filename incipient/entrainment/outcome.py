"""Entrainment by gusts as data, with the lines on it for a reader."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from ..critical.outcome import Threshold, with_error
from .lasting import RateOfLasting

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class OfStrength:
    """Motion in one mean flow.

    strength: of the mean flow over the scene's; shields: its Shields number
    probability: of motion at an instant; low, high: between which it is by the errors of threshold and series, and with
        the other law of the same intensity
    rate: how often the critical strength is exceeded anew in unit time; None: not known
    lasting: how often by a gust that lasts long enough to move the grain out of its pocket; None: not asked for
    """

    strength: float
    shields: float
    probability: float
    low: float
    high: float
    rate: float | None
    lasting: RateOfLasting | None = None


@dataclass(frozen=True)
class Quantile:
    """The mean flow in which motion has a probability at an instant.

    strength, shields, rate, lasting: as of `OfStrength`
    terms: errors of the Shields number by source; empty: none is known
    """

    probability: float
    strength: float
    shields: float
    terms: dict[str, float]
    rate: float | None
    lasting: RateOfLasting | None = None

    @property
    def error(self) -> float | None:
        """Error of the Shields number, the terms added; None: not known."""
        return sum(self.terms.values()) if "flow" in self.terms else None

    def line(self) -> str:
        """Probability and Shields number for a reader."""
        sources = ", ".join(f"{name} {error:.1e}" for name, error in self.terms.items())
        rate = "" if self.rate is None else f"; {self.rate:.3g} in unit time"
        if self.lasting is not None:
            rate += f", {self.lasting.words()}"
        shown = with_error(self.shields, self.error)
        flow = "" if self.error is not None else "; error of the flow not known"
        where = f"Shields number {shown}, {self.strength:.4g} times the flow"
        return f"{self.probability:>8.3g}  {where} ({sources}){flow}{rate}"


@dataclass(frozen=True)
class Entrainment:
    """How probable motion is.

    threshold: the critical steady flow
    law: of the factor of the velocity
    scene: motion in the scene's own mean flow
    quantiles: mean flows of given probabilities; curve: motion in mean flows from weak to strong
    assumed: what is, in one line each
    """

    title: str
    threshold: Threshold
    law: str
    scene: OfStrength
    quantiles: tuple[Quantile, ...]
    curve: tuple[OfStrength, ...]
    assumed: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain data for entrainment.json."""
        quantiles = [{**asdict(one), "error": one.error} for one in self.quantiles]
        named = ("factor", "shields", "shear_reynolds", "mode", "errors", "applicable")
        return {
            "schema_version": SCHEMA_VERSION,
            "title": self.title,
            "law": self.law,
            "threshold": {name: getattr(self.threshold, name) for name in named},
            "scene": asdict(self.scene),
            "quantiles": quantiles,
            "curve": [asdict(one) for one in self.curve],
            "assumed": list(self.assumed),
        }

    def text(self) -> str:
        """What was found, in a few lines."""
        critical, own = self.threshold, self.scene
        rate = "not known" if own.rate is None else f"{own.rate:.3g} times in unit time"
        if own.lasting is not None:
            rate += f", {own.lasting.words()}"
        steady = with_error(critical.shields, critical.errors["shields"])
        unknown = (
            ""
            if critical.bars is not None and critical.bars.terms
            else "; error of the flow not known"
        )
        lines = [
            f"steady flow         moves the grain from Shields number {steady} on, {critical.mode}",
            f"flow of the scene   probability of motion at an instant {own.probability:.3g} "
            f"({own.low:.3g} to {own.high:.3g}{unknown}); exceeded anew {rate}",
            "probability of motion at an instant, and the mean flow",
            *(one.line() for one in self.quantiles),
            *(f"assumed             {one}" for one in self.assumed),
        ]
        return "\n".join(lines)
