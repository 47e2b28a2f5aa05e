"""Coupling of the flow with a moving grain, a free surface and turbulence; tractions, remeshing, energy."""
