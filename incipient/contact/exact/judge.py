"""The exact judge's answers to one case, as the verdict, the comparison of judges and the sampling use them."""

from dataclasses import dataclass
from typing import Any

from incipient.arrays import Floats
from incipient.contact import equilibrium
from incipient.contact.exact.release import require_inertia
from incipient.contact.model import Load
from incipient.errors import ConvergenceError
from incipient.geometry.contacts import Contacts

MassAndInertia = tuple[float, Floats]  # mass, and inertia (3, 3) about the centre of mass


@dataclass(frozen=True, eq=False)
class Exact:
    """The safety factor, and the incipient motion where the grain moves.

    `motion` is None where the grain rests, where mass and inertia are not given, and where no solution was
    found, which `unsolved` then says.
    """

    safety: equilibrium.SafetyFactor
    motion: equilibrium.IncipientMotion | None
    unsolved: str = ""

    @property
    def moves(self) -> bool:
        """Whether no contact forces in the friction cones balance the load as it is."""
        return not self.safety.held

    @property
    def label(self) -> str:
        """The mode in words; where it is not known only that the grain moves."""
        if self.motion is not None and self.motion.moves:
            return self.motion.mode.label
        return "moves" if self.moves else "rest"

    def to_dict(self) -> dict[str, Any]:
        """Both answers as plain data for JSON."""
        motion = None if self.motion is None else self.motion.to_dict()
        said = {"moves": self.moves, "mode": self.label, "unsolved": self.unsolved}
        return said | {"safety": self.safety.to_dict(), "motion": motion}


def judged(
    load: Load, contacts: Contacts, friction: float, mass_and_inertia: MassAndInertia | None = None
) -> Exact:
    """Ask the exact judge for the safety factor and, if the grain moves, for how it does.

    Raises SceneError as `equilibrium.safety_factor` and `equilibrium.incipient_motion` do.
    """
    if mass_and_inertia is not None:  # also where the grain rests, and neither is used
        require_inertia(*mass_and_inertia)
    safety = equilibrium.safety_factor(load, contacts, friction)
    if safety.held or mass_and_inertia is None:
        return Exact(safety, None)
    try:
        return Exact(
            safety, equilibrium.incipient_motion(load, contacts, friction, *mass_and_inertia)
        )
    except ConvergenceError as error:
        return Exact(safety, None, str(error))
