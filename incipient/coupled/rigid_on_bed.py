"""Rigid body in a fluid and on a bed: contact impulses act within each coupling iteration."""

from __future__ import annotations

from typing import Any

from ..arrays import Floats
from ..body.contact_motion import ContactMotion, ContactStep
from ..body.state import BodyState
from .rigid import RigidPart


class RigidPartOnBed(RigidPart):
    """Rigid body that rolls, slides or rests on a bed; `contacts` at the end of the last step."""

    def __init__(self, *others: Any, contact: ContactMotion, **named: Any):
        super().__init__(*others, **named)
        self.contact = contact
        self.contacts = contact.closed(self.state.placement)
        self._step: ContactStep | None = None
        self._length = 0.0

    def accept(self) -> None:
        super().accept()
        if self._step is not None:
            self.contacts = self._step.contacts
        self._step = None  # as in a resumed run

    def take_over(self, was: RigidPart) -> None:
        assert isinstance(was, RigidPartOnBed)
        super().take_over(was)
        self.contacts = was.contacts

    def predicted(self, length: float, order: int) -> BodyState:
        return self.contact.kept_out(super().predicted(length, order))

    def _moved(self, length: float, mean: Floats, added: Floats, guess: Floats) -> BodyState:
        tried = self._step if self._length == length else None
        step = self.contact.step(self.state, length, mean, added, guess, self.contacts, tried)
        self._motion, self._step, self._length = step.motion, step, length
        return step.end
