"""Contact of a resting grain with its bed: the paper's criteria of incipient motion and the exact criterion."""

from incipient.contact.acceleration import IncipientMotion, incipient_motion
from incipient.contact.batch import Batch, Cases, judge_many
from incipient.contact.paper import Classification, Mode, classify
from incipient.contact.pile import Interface, judge_pile
from incipient.contact.problem import Load
from incipient.contact.safety import SafetyFactor, safety_factor
from incipient.contact.verdict import Verdict, judge
from incipient.geometry.contacts import Contacts
from incipient.geometry.settle import touching

__all__ = [
    "Batch",
    "Cases",
    "Classification",
    "Contacts",
    "IncipientMotion",
    "Interface",
    "Load",
    "Mode",
    "SafetyFactor",
    "Verdict",
    "classify",
    "incipient_motion",
    "judge",
    "judge_many",
    "judge_pile",
    "safety_factor",
    "touching",
]
