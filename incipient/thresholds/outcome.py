"""The critical flow of a scene as data and as text."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..contact import Contacts, Load
from ..files import plain
from ..results.si import si_lines

if TYPE_CHECKING:
    from ..results.accuracy import Adaptation
    from .critical import CriticalBars

Range = tuple[float, float]
DOUBTED = "in the last flow of the search "  # prefix of a note on walls outside the model's range
AS_THEY_ARE = (
    *("computed", "steepness", "held_to", "reason", "size", "nominal", "shields_nominal", "notes"),
    *("ranges", "mode", "verdict", "unsolved", "cost", "si"),
)


@dataclass(frozen=True)
class SolvedFlow:
    """A computed flow: its factor and safety factor."""

    factor: float
    safety_factor: float


@dataclass(frozen=True)
class Outcome:
    """The outcome of a search for a critical flow.

    factor:   critical speed over the scene's; 0: any flow, or the weight alone, moves the grain; inf: no computed flow
              does
    held_to:  factor up to which the grain is stable; inf: always
    trials:   the computed flows in order; unsolved: factors without a converged steady flow
    reason:   why there is no critical flow, or none computed near it
    """

    factor: float
    held_to: float
    trials: tuple[SolvedFlow, ...]
    unsolved: tuple[float, ...]
    reason: str

    @property
    def is_critical(self) -> bool:
        """Whether there is a critical flow."""
        return 0.0 < self.factor < np.inf


@dataclass(frozen=True)
class Threshold(Outcome):
    """The critical flow of a scene, or the reason for none.

    computed:        critical speed for the uncorrected load, if `factor` is corrected
    shields:         Shields number tau_b / ((rho_s - rho_f) g d), tau_b of the undisturbed flow at its datum
    reynolds:        the scene's Reynolds number, critical
    shear_reynolds:  u* d / nu with u*^2 = tau_b / rho_f
    size:            d, the largest diameter of the grain
    nominal:         its nominal diameter, of the sphere of equal volume, in 2-D the disc of equal area
    mode:            of incipient motion, by the exact criterion
    load:            the critical load; otherwise that of a weak flow, or of the strongest one computed
    verdict:         of both criteria there
    stress_power:    approximate power of the factor in the bed stress
    steepness:       power of the factor in the load; None without a critical flow
    bars:            error bars of the factor; None: see `without_bars`, or no threshold
    si:              the critical flow and its load in SI units (`results.si`), None without [units]
    """

    shields: float
    reynolds: float
    shear_reynolds: float
    size: float
    nominal: float
    mode: str
    load: Load
    contact_forces: np.ndarray
    contacts: Contacts
    verdict: dict[str, Any]
    cost: dict[str, Any]
    stress_power: float = 1.0
    steepness: float | None = None
    notes: tuple[str, ...] = ()
    bars: CriticalBars | None = None
    without_bars: str = ""
    adaptation: Adaptation | None = None
    si: dict[str, Any] | None = None
    computed: float | None = None

    @property
    def shields_nominal(self) -> float:
        return self.shields * self.size / self.nominal

    @property
    def ranges(self) -> dict[str, Range | None]:
        """Ends of the error bars of factor, shields, reynolds and shear_reynolds; None: not known."""
        stress = self.stress_power
        powers = {"factor": 1.0, "shields": stress, "reynolds": 1.0, "shear_reynolds": 0.5 * stress}
        if self.bars is None or not self.bars.terms:
            return dict.fromkeys(powers)
        low, high = self.bars.low / self.factor, self.bars.high / self.factor
        values = {name: (getattr(self, name), power) for name, power in powers.items()}
        return {name: (low**power * x, high**power * x) for name, (x, power) in values.items()}

    def to_dict(self) -> dict[str, Any]:
        return {
            **{name: getattr(self, name) for name in (*self.ranges, *AS_THEY_ARE)},
            "schema_version": 4,
            "sentence": self.sentence,
            "error_bars": self.bars and self.bars.to_dict(),
            "without_error_bars": self.without_bars,
            "adaptation": plain(self.adaptation),
            "load": asdict(self.load),
            "contacts": {**asdict(self.contacts), "forces": self.contact_forces},
            "trials": [asdict(trial) for trial in self.trials],
        }

    def text(self) -> str:
        lines = [f"threshold           {self.sentence}"]
        if self.is_critical:
            ranges = self.ranges.items()
            shown = {name: with_range(getattr(self, name), ends) for name, ends in ranges}
            lines += [
                f"Shields number      {shown['shields']}",
                *(f"                    {note}" for note in self.notes),
                f"Reynolds number     {shown['reynolds']}   shear Reynolds number {shown['shear_reynolds']}",
                *si_lines(self.si),
            ]
        if self.bars is not None:
            lines += self.bars.lines()
        elif self.without_bars:
            lines.append(f"error bars          {self.without_bars}")
        if self.adaptation is not None:
            lines += self.adaptation.lines()
        unsolved = f", {len(self.unsolved)} not converged" if self.unsolved else ""
        return "\n".join([*lines, f"flows solved        {len(self.trials)}{unsolved}"])

    @property
    def sentence(self) -> str:
        """The critical flow and the mode, or the reason for none."""
        if self.is_critical:
            factor = with_range(self.factor, self.ranges["factor"])
            if self.computed not in (None, self.factor):
                factor += f", as computed {self.computed:.4g},"
            return f"{factor} times the flow of the scene; then the grain begins {self.mode}"
        if self.factor == 0.0 and self.verdict["safety_status"] == "NO_RESERVE":
            load = "in one whose force is a tenth of its submerged weight"
            return f"zero: {self.reason}, {self.mode} {load}"
        if self.factor == 0.0:
            return f"none: {self.reason}"
        if not np.isfinite(self.held_to):
            why = "whose load grows in proportion (no inertia)"
            return f"none: no strength of this flow moves the grain, {why}"
        tried = ", ".join(f"{factor:.3g}" for factor in self.unsolved)
        where = f"none up to {self.held_to:.3g} times the flow of the scene; {self.reason}"
        return f"{where} (tried: {tried})" if tried else where

    def shields_note(self, gdim: int) -> str:
        """Definition of the Shields number, and its value with the nominal diameter."""
        means = (
            f"tau_b/((rho_s - rho_f) g d), d = {self.size:g}: the largest diameter of the grain; "
        )
        if abs(self.nominal - self.size) <= 1e-9 * self.size:
            return means + "the nominal one is the same"
        what = "disc of equal area" if gdim == 2 else "sphere of equal volume"
        nominal = f"{self.shields_nominal:.4g} with its nominal diameter {self.nominal:.4g}"
        return f"{means}{nominal}, that of the {what}"


def with_range(value: float, ends: Range | None) -> str:
    """A number with the ends of its error bar, rounded outwards; four digits without known ends."""
    if ends is None:
        return f"{value:.4g}"
    low, high = ends
    half = 0.5 * (high - low) if np.isfinite(high) else value - low
    if np.isinf(high) and low <= 0.0:
        return f"{value:.2g} (error without bound)"
    if half <= 1e-6 * value:  # further digits are below the tolerance of the search
        return f"{value:.6g}" if np.isfinite(high) else f"{value:.6g} or more"
    digits = max(0, 1 - int(np.floor(np.log10(half))))
    unit = 10.0**-digits
    least, most = np.floor(low / unit + 1e-6) * unit, np.ceil(high / unit - 1e-6) * unit
    upper = f"to {most:.{digits}f}" if np.isfinite(most) else "or more"
    return f"{value:.{digits}f} ({least:.{digits}f} {upper})"
