"""Where the grain is touched, what the bed answers, and the paper's criteria of incipient motion."""

from incipient.contact.batch import Batch, Cases, judge_many
from incipient.contact.model import Load
from incipient.contact.paper import criteria
from incipient.contact.paper.criteria import Classification, Mode, classify
from incipient.geometry.closest import exposed, require_on_grain, touching
from incipient.geometry.contacts import Contacts

__all__ = [
    "Batch",
    "Cases",
    "Classification",
    "Contacts",
    "Load",
    "Mode",
    "classify",
    "criteria",
    "exposed",
]
__all__ += ["judge_many", "require_on_grain", "touching"]
