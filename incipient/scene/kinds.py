"""All grains and all beds that a scene, or a case, may have, in the plane and in space."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

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
from .solids import Box, Ellipsoid, Mesh, Polyhedron, Sphere, Spheres, Superquadric
from .terrains import HeightMapBed, MeshBed, RidgeBed, SphereBed

PlaneBody = Disc | Ellipse | Rectangle | Polygon | Superellipse | Star | Discs
SolidBody = Sphere | Ellipsoid | Superquadric | Box | Polyhedron | Spheres | Mesh
PlaneBed = Flat | Inclined | Sinusoidal | HalfDiscs | Polyline
Terrain = SphereBed | RidgeBed | HeightMapBed | MeshBed

Body = Annotated[PlaneBody | SolidBody, Field(discriminator="shape")]
Bed = Annotated[PlaneBed | Terrain, Field(discriminator="kind")]
