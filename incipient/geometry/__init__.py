"""Grains, beds, the curves they are made of, and how one rests on the other; numpy only."""

from incipient.geometry.bed import Bed, Flat, HalfDiscs, Polyline, Sinusoidal
from incipient.geometry.curves import Arc, Curve, Line, Spline
from incipient.geometry.grain import Disc, Ellipse, Grain, Placement, Polygon, Rectangle
from incipient.geometry.rest import clearance, lifted, rest

__all__ = [
    "Arc",
    "Bed",
    "Curve",
    "Disc",
    "Ellipse",
    "Flat",
    "Grain",
    "HalfDiscs",
    "Line",
    "Placement",
    "Polygon",
    "Polyline",
    "Rectangle",
    "Sinusoidal",
    "Spline",
    "clearance",
    "lifted",
    "rest",
]
