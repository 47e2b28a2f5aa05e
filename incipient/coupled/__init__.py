"""Coupling of the flow with a moving grain, a free surface and turbulence; tractions, remeshing, energy."""

WORKS = ("flow", "gravity", "friction", "impact")  # what does work on a grain on its bed
