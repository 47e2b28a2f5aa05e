"""Contradictions of a grain that moves on its bed, and of keys that only it reads."""

from collections.abc import Iterator
from typing import Any

from .messages import Problem, problem
from .model import Contact, Time

TOUCHES = 'body.motion = "released", or "free" with body.on_contact = "touch"'


def contradictory(
    body: Any, contact: Contact | None, time: Time | None, bed: Any
) -> Iterator[Problem]:
    """What a grain that moves on its bed lacks or cannot go with, and keys that only it reads."""
    if body is None or not body.touches:
        yield from _ignored(contact, time)
        return
    if contact is None:
        why = "is missing, but the grain touches the bed while it moves"
        yield problem("contact.friction", why, "add a section [contact] with a friction")
    elif contact.kinetic_friction is not None and contact.kinetic_friction > contact.friction:
        why = f"is {contact.kinetic_friction:g}, more than contact.friction = {contact.friction:g}"
        yield problem("contact.kinetic_friction", why, "give at most contact.friction")
    if body.locked:
        yield problem(
            "body.locked",
            "but a grain that touches the bed is free in all its motions",
            "leave it out",
        )
    if time is not None and time.tolerance is not None:
        why = "but velocities jump where the grain touches the bed, and steps cannot adapt to that"
        yield problem("time.tolerance", why, "leave it out: steps are of a fixed length")
    if time is not None and time.until == "out-of-pocket" and (bed is None or bed.kind == "flat"):
        yield problem("time.until", '"out-of-pocket" but the bed is flat', 'use "at-rest" or "end"')


def excluded(body: Any, contact: bool | str) -> Iterator[Problem]:
    """A value of effects.contact that a grain which touches its bed cannot go with."""
    if body is not None and body.touches and contact is False:
        why = "is false, but the grain touches the bed while it moves"
        yield problem("effects.contact", why, "leave it out")


def _ignored(contact: Contact | None, time: Time | None) -> Iterator[Problem]:
    for key in ("kinetic_friction", "restitution", "rolling_resistance"):
        if contact is not None and getattr(contact, key) != Contact.model_fields[key].default:
            yield problem(f"contact.{key}", f"is read only with {TOUCHES}", "leave it out")
    if time is not None and time.until != "end":
        yield problem("time.until", f"is read only with {TOUCHES}", "leave it out")
