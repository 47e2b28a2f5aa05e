"""Turbulence of the flow, by a model of its means."""
