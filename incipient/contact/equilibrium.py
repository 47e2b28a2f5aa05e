"""The exact judge: rigid-body mechanics with Coulomb friction at contact points, the second of two judges.

Two questions: by how much may the flow's load grow before the contacts can no longer balance it
(`safety_factor`), and with which accelerations does the grain answer a load at the instant of release
(`incipient_motion`)? docs/contact.md states both problems.
"""

from incipient.contact.exact.motion import IncipientMotion, Solution, incipient_motion
from incipient.contact.exact.motion_modes import ContactState, Mode, Uniqueness
from incipient.contact.exact.safety import ConeState, SafetyFactor, SafetyStatus, safety_factor
from incipient.contact.loads.directions import Directed, SafetyOverDirection, safety_over_direction

__all__ = ["ConeState", "ContactState", "Directed", "IncipientMotion", "Mode", "SafetyFactor"]
__all__ += ["SafetyOverDirection", "SafetyStatus", "Solution", "Uniqueness", "incipient_motion"]
__all__ += ["safety_factor", "safety_over_direction"]
