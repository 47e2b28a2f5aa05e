"""Scenes as validated data."""

from .domain import Domain
from .file import dumps, example, load, loads, save, schema
from .flows import (
    ExpressionFlow,
    Flow,
    Lid,
    LogLaw,
    OpenChannel,
    Oscillatory,
    Poiseuille,
    Shear,
    Still,
    Uniform,
)
from .model import Bed, Body, Contact, Effects, Fluid, Gravity, Output, Scene, Time, register
from .numerics import Numerics
from .shapes import (
    Disc,
    Discs,
    Ellipse,
    Flat,
    HalfDiscs,
    Inclined,
    Polygon,
    Polyline,
    Rectangle,
    Sinusoidal,
    Star,
    Superellipse,
)
from .solids import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    Mesh,
    Polyhedron,
    Sphere,
    Spheres,
    Superquadric,
)
from .surface import Surface
from .terrains import HeapBed, HeightMapBed, MeshBed, RidgeBed, SphereBed
from .turbulence import Turbulence
from .units import Units

__all__ = [
    "Bed",
    "Body",
    "Box",
    "Capsule",
    "Contact",
    "Cylinder",
    "Disc",
    "Discs",
    "Domain",
    "Effects",
    "Ellipse",
]
__all__ += ["Ellipsoid", "ExpressionFlow", "Flat", "Flow", "Fluid", "Gravity", "HalfDiscs"]
__all__ += [
    "HeapBed",
    "HeightMapBed",
    "Inclined",
    "Lid",
    "LogLaw",
    "Mesh",
    "MeshBed",
    "Numerics",
    "OpenChannel",
]
__all__ += [
    "Oscillatory",
    "Output",
    "Poiseuille",
    "Polygon",
    "Polyhedron",
    "Polyline",
    "Rectangle",
    "RidgeBed",
]
__all__ += ["Scene", "Shear", "Sinusoidal", "Sphere", "SphereBed", "Spheres", "Star", "Still"]
__all__ += [
    "Superellipse",
    "Superquadric",
    "Surface",
    "Time",
    "Turbulence",
    "Uniform",
    "Units",
    "dumps",
]
__all__ += ["example", "load", "loads", "register", "save", "schema"]
