"""What a gust cannot go with, each with the remedy."""

from collections.abc import Iterator

from .flows import Flow
from .messages import Problem, problem
from .model import Time

FEWEST_STEPS = 2  # of time, in the duration of a gust


def contradictory(
    flow: Flow, time: Time | None, has_surface: bool, sides: str | None
) -> Iterator[Problem]:
    """What keeps a flow from having the gust that it asks for."""
    gust = getattr(flow, "gust", None)
    if gust is None:
        return
    if time is None:
        yield problem(
            "flow.gust", "changes the flow in time", "add a section [time] or leave it out"
        )
    elif gust.shape != "points" and FEWEST_STEPS * time.step > gust.duration:
        why = f"is {gust.duration:g}, less than {FEWEST_STEPS} time steps of {time.step:g}"
        yield problem("flow.gust.duration", why, "reduce time.step")
    if has_surface:
        yield problem(
            "flow.gust", "is not simulated below a free surface", 'use domain.top = "slip"'
        )
    if sides == "wall":
        why = "is not simulated between walls across the width"
        yield problem("flow.gust", why, 'set domain.sides = "slip" or "stream"')
