"""Scenes built from Python that are wrong: one clear line for each mistake, contradiction and retired key."""

import copy
import math
from functools import partial

import pytest
from scenes import CHANNEL, DISC, FLOW_SCALE, message, scene, sphere_on_plane

from incipient.interrupt import say
from incipient.scene import (
    Box,
    Capsule,
    Contact,
    Cylinder,
    Disc,
    Discs,
    Domain,
    Effects,
    Ellipse,
    Ellipsoid,
    ExpressionFlow,
    Fluid,
    Gravity,
    HalfDiscs,
    HeapBed,
    HeightMapBed,
    Inclined,
    Lid,
    LogLaw,
    Mesh,
    MeshBed,
    Numerics,
    OpenChannel,
    Output,
    Poiseuille,
    Polygon,
    Polyhedron,
    Polyline,
    Rectangle,
    Scene,
    Shear,
    Sinusoidal,
    Sphere,
    SphereBed,
    Spheres,
    Star,
    Still,
    Superellipse,
    Surface,
    Time,
    Uniform,
    Units,
    messages,
)
from incipient.scene.file import example, loads
from incipient.scene.flows import Gust

ONE_KEY = [
    *(
        (
            lambda letter=letter: Scene(title=f"A disc{letter}[2J"),
            "Scene: title: has control characters, which terminals execute; remove them",
        )
        for letter in "\x1b\x9b\r"
    ),
    (lambda: Domain(length=-1, height=1), "Domain: length: is -1; give a number greater than 0"),
    (lambda: Domain(length=1, height=0), "Domain: height: is 0; give a number greater than 0"),
    (lambda: Domain(length=math.nan, height=1), "Domain: length: is nan; give a finite number"),
    (lambda: Domain(length=math.inf, height=1), "Domain: length: is inf; give a finite number"),
    (
        lambda: Domain(length=1e300, height=1),
        "Domain: length: is 1e+300; give numbers of at most 1e+30 in",
    ),
    (
        lambda: Domain(length=1e-300, height=1),
        "Domain: length: is 1e-300; give a number of at least 1e-30",
    ),
    (
        lambda: Domain(length=1, height=1, origin=(0, -1e99)),
        "Domain: origin: holds 1e+99; give numbers of",
    ),
    (
        lambda: Shear(rate=1e300),
        "Shear: rate: is 1e+300; give numbers of at most 1e+30 in size, or choose",
    ),
    (lambda: Domain(length="1", height=1), 'Domain: length: is "1"; give a number'),
    (lambda: Domain(length=True, height=1), "Domain: length: is true; give a number"),
    (
        lambda: Domain(length=10**400, height=1),
        "Domain: length: is 1000000000000000000000000000000000000...; give a",
    ),
    (
        lambda: Domain(length=1),
        "Domain: height: is missing; add it: Extent from the lower side to the top",
    ),
    (
        lambda: Domain(length=1, height=1, origin=(1,)),
        "Domain: origin: has 1 item; give 2 or more",
    ),
    (
        lambda: Domain(length=1, height=1, origin=(1, 2, 3)),
        "Domain: origin: has 3 items; give two, as in [x, y]",
    ),
    (
        lambda: Domain(length=1, height=1, origin=(1, math.nan)),
        "Domain: origin[1]: is nan; give a finite number",
    ),
    (
        lambda: Domain(length=1, height=1, origin=3),
        "Domain: origin: is 3; give a list in [brackets]",
    ),
    (
        lambda: Domain(length=1, height=1, top="open"),
        'Domain: top: "open" is not known; use "auto", "wall", "slip", "stream" or "free-surface"',
    ),
    (
        lambda: Surface(elevation="sin(t)"),
        'Surface: elevation: "sin(t)" depends on t; use x, y only',
    ),
    (
        lambda: Surface(points=[(0, 0), (1, 0.1)], elevation="x"),
        "Surface: points: are given with a formula for the elevation; leave one of them out",
    ),
    (
        lambda: Surface(points=[(1, 0), (0, 0.1)]),
        "Surface: points: do not increase in x; give two or more points sorted by x, each x once",
    ),
    (
        lambda: Surface(file="elevation.csv", points=[(0, 0), (1, 0.1)]),
        "Surface: file: both file and points are given; give one of them",
    ),
    (
        lambda: Gust(shape="points"),
        "Gust: file: neither file nor points is given; give one of them",
    ),
    (
        lambda: Gust(shape="points", points=[(1, 1), (0, 2)]),
        "Gust: points: are fewer than two, or their times do not increase; give two or more",
    ),
    (
        lambda: Gust(shape="cosine", points=[(0, 1), (1, 2)]),
        'Gust: points: are not read with shape = "cosine"; set shape = "points"',
    ),
    (
        lambda: Surface(file="nowhere.csv"),
        "Surface: file: nowhere.csv cannot be read (No such file or directory); give the name of a CSV file of x, y",
    ),
    (
        lambda: Fluid(reynolds=-3, scale="flow"),
        "Fluid: reynolds: is -3; give a number greater than 0",
    ),
    (
        lambda: Fluid(reynolds=3),
        'Fluid: scale: is missing; add it, "grain" or "flow": L is the largest diameter of the grain',
    ),
    (
        lambda: Fluid(renolds=3, scale="flow"),
        'Fluid: renolds: unknown key; did you mean "reynolds"?',
    ),
    (
        lambda: Fluid(reynolds=3, scale="flow", inertia=1),
        "Fluid: inertia: is 1; give true or false",
    ),
    (
        lambda: Lid(rate=3),
        'Lid: rate: unknown key for "lid"; known are kind, velocity',
    ),
    (
        lambda: ExpressionFlow(components=("y*", "0")),
        'ExpressionFlow: components[0]: "y*" is not a formula (invalid syntax); use numbers, x, y',
    ),
    (
        lambda: ExpressionFlow(components=("z", "0")),
        'ExpressionFlow: components: "z" depends on z but they are two, as in 2-D; give three, or use x, y, t',
    ),
    (
        lambda: ExpressionFlow(components=("y", 0)),
        'ExpressionFlow: components[1]: is 0; give text in "quotes"',
    ),
    (
        lambda: Disc(diameter=1),
        "Disc: x: neither x nor centre is given; give x to rest on the bed, or centre",
    ),
    (
        lambda: Disc(diameter=1, x=1, centre=(1, 2)),
        "Disc: x: both x and centre are given; leave one out",
    ),
    (
        lambda: Disc(diameter=1, x=1, density=-1),
        "Disc: density: is -1; give a number of at least 0",
    ),
    (
        lambda: Disc(diameter=1, x=1, motion="free", density=2),
        "Disc: x: a moving grain starts away from the bed; give centre instead of x",
    ),
    (
        lambda: Disc(diameter=1, centre=(1, 1), motion="prescribed"),
        'Disc: course: is missing though the motion is prescribed; add it, or set motion = "fixed"',
    ),
    (
        lambda: Disc(diameter=1, centre=(1, 1), motion="prescribed", course=("x", "0", "0")),
        'Disc: course[0]: "x" depends on x; use t only',
    ),
    (
        lambda: Disc(diameter=1, centre=(1, 1), motion="free", density=1, locked=("z",)),
        'Disc: locked[0]: "z" is not known; use "x", "y" or "angle"',
    ),
    (
        lambda: Ellipse(semi_axes=(1, -1), x=1),
        "Ellipse: semi_axes[1]: is -1; give a number greater than 0",
    ),
    (
        lambda: Ellipse(semi_axes=(1, 1e-9), x=1),
        "Ellipse: shape: the grain fills less than 1e-07 of a square or cube of its size; make it thicker",
    ),
    (
        lambda: Ellipsoid(semi_axes=(0.7, 0.5, 1e-9), x=1),
        "Ellipsoid: shape: the grain fills less than 1e-07 of a square or cube of its size; make it thicker",
    ),
    (
        lambda: Capsule(diameter=1e-9, length=1, x=1),
        "Capsule: shape: the grain fills less than 1e-07 of a square or cube of its size; make it thicker",
    ),
    (
        lambda: Rectangle(width=1, height=2, corner_radius=0.6, x=1),
        "Rectangle: corner_radius: is 0.6, more than half the shorter side, 0.5; make it smaller",
    ),
    (
        lambda: Polygon(vertices=[(0, 0), (1, 1)], x=1),
        "Polygon: vertices: has 2 items; give 3 or more",
    ),
    (
        lambda: Polygon(vertices=[(0, 0), (2, 1), (2, 0), (0, 1)], x=1),
        "Polygon: vertices: the sides after vertices 0 and 2 meet (counted from 0); list the vertices",
    ),
    (
        lambda: Polygon(vertices=[(0, 0), (2, 0), (2, 2), (1, 0), (0, 2)], x=1),
        "Polygon: vertices: the sides after vertices 0 and 2 meet",
    ),
    (
        lambda: Polygon(vertices=[(0, 0), (1, 0), (0, 0), (0, 1)], x=1),
        "Polygon: vertices: a vertex is given twice; leave the repeated one out",
    ),
    (
        lambda: Polygon(vertices=[(0, 0), (1, 1), (2, 2)], x=1),
        "Polygon: vertices: the polygon has no area; give vertices that are not all on one line",
    ),
    (
        lambda: Polygon(vertices=[(0, 0), (1,), (2, 2)], x=1),
        "Polygon: vertices[1][1]: is missing; add it",
    ),
    (
        lambda: Superellipse(semi_axes=(1, 1), exponent=1.5, x=1),
        "Superellipse: exponent: is 1.5; give a number of at least 2",
    ),
    (
        lambda: Star(radius=1, cosines=(0, 1.5), x=1),
        "Star: cosines: the radius of the star is -0.5 at 90 degrees; keep it positive",
    ),
    (
        lambda: Discs(discs=[(0, 0, 1), (3, 0, 1)], x=1),
        "Discs: discs: number 1 of the union does not overlap the others; move it closer",
    ),
    (
        lambda: Superellipse(semi_axes=(1, 1), exponent=20.5, x=1),
        "Superellipse: exponent: is 20.5; give a number of at most 20",
    ),
    (
        lambda: Star(radius=1, sines=(1.5,), x=1),
        "Star: sines: the radius of the star is -0.5 at 270 degrees; keep it positive",
    ),
    (
        lambda: Star(radius=1, cosines=("a",), x=1),
        'Star: cosines[0]: is "a"; give a number',
    ),
    (lambda: Discs(discs=[], x=1), "Discs: discs: has 0 items; give 1 or more"),
    (lambda: Discs(discs=[[0, 0]], x=1), "Discs: discs[0][2]: is missing; add it"),
    (
        lambda: Discs(discs=[(0, 0, 1), (0.1, 0, 0.5)], x=1),
        "Discs: discs: disc 1 of the union lies within the others; leave it out",
    ),
    (
        lambda: Discs(discs=[(0, 0, 0)], x=1),
        "Discs: discs[0][2]: is 0; give a number greater than 0",
    ),
    (
        lambda: Disc(diameter=1, centre=(1, 2), settle=True),
        "Disc: settle: a grain with a given centre does not settle; give x instead of centre, or leave settle out",
    ),
    (lambda: Inclined(slope=95), "Inclined: slope: is 95; give a number less than 90"),
    (
        lambda: Sinusoidal(amplitude=-1, wavelength=1),
        "Sinusoidal: amplitude: is -1; give a number of at least 0",
    ),
    (
        lambda: HalfDiscs(radius=1, spacing=1.5),
        "HalfDiscs: spacing: 1.5 is less than two radii, 2: the half-discs overlap; enlarge spacing or",
    ),
    (
        lambda: Shear(datum="top"),
        'Shear: datum: is "top"; give a number or use "auto", "effective", "crest" or "mean"',
    ),
    (lambda: Uniform(datum=True), "Uniform: datum: is true; give a number or use"),
    (lambda: Poiseuille(datum=math.nan), "Poiseuille: datum: is nan; give a finite number or use"),
    (lambda: OpenChannel(datum=10**400), "OpenChannel: datum: is 1"),
    (lambda: Lid(datum="mean"), 'Lid: datum: unknown key for "lid"; known are kind, velocity'),
    (lambda: Still(datum=0.0), 'Still: datum: unknown key for "still"; known are kind, velocity'),
    (
        lambda: ExpressionFlow(components=("y", "0"), datum="crest"),
        'ExpressionFlow: datum: unknown key for "expression"; known are kind, components, velocity',
    ),
    (lambda: Polyline(), "Polyline: file: neither file nor points is given; give one of them"),
    (
        lambda: Polyline(file="a.csv", points=[(0, 0), (1, 0)]),
        "Polyline: file: both file and points are given; give one of them",
    ),
    (lambda: Polyline(file=3), 'Polyline: file: is 3; give text in "quotes"'),
    (lambda: Polyline(points=[(0, 0)]), "Polyline: points: has 1 item; give 2 or more"),
    (
        lambda: Polyline(points=[(0, 0), (1, 2), (1, 2)]),
        "Polyline: points: has x = 1 after x = 1; sort the points by ascending x, each place once",
    ),
    (lambda: Gravity(acceleration=-1), "Gravity: acceleration: is -1; give a number of at least 0"),
    (lambda: Contact(friction=-0.1), "Contact: friction: is -0.1; give a number of at least 0"),
    (lambda: Contact(friction=0.1, gap=0), "Contact: gap: is 0; give a number greater than 0"),
    (
        lambda: Contact(friction=0.1, gap=0.101),
        "Contact: gap: is 0.101; give a number of at most 0.1",
    ),
    (
        lambda: Contact(friction=0.1, tolerance=3.0),
        "Contact: tolerance: is 3.0; give a number of at most 0.1",
    ),
    *[
        (
            lambda key=key, value=value: Disc(diameter=1, x=1, density=2, **{key: value}),
            f'Disc: {key}: is read only with motion = "free", but the motion is "fixed"; leave it out, or',
        )
        for key, value in (
            ("velocity", (1, 0)),
            ("spin", 1),
            ("locked", ("x",)),
            ("on_contact", "touch"),
        )
    ],
    *[
        (
            lambda key=key, value=value: Disc(
                diameter=1,
                centre=(1, 1),
                motion="prescribed",
                course=("0", "0", "0"),
                **{key: value},
            ),
            f'Disc: {key}: is read only with motion = "free", but the motion is "prescribed"; leave it out, or',
        )
        for key, value in (
            ("velocity", (1, 0)),
            ("spin", 1),
            ("locked", ("x",)),
            ("on_contact", "touch"),
        )
    ],
    (
        lambda: Disc(diameter=1, x=1, course=("0", "0", "0")),
        'Disc: course: is read only with motion = "prescribed", but the motion is "fixed"; leave it out, or',
    ),
    (
        lambda: Disc(diameter=1, x=1, density=2, mass=1),
        "Disc: mass: is given with density, from which it follows; leave one of them out",
    ),
    (
        lambda: Time(end=1, step=2),
        "Time: step: is 2 but time ends at 1; reduce step or enlarge end",
    ),
    (lambda: Numerics(order=5), 'Numerics: order: 5 is not known; use "auto", 2, 3 or 4'),
    (lambda: Numerics(order=True), 'Numerics: order: true is not known; use "auto", 2, 3 or 4'),
    (lambda: Numerics(order="high"), 'Numerics: order: "high" is not known; use "auto", 2, 3'),
    (lambda: Numerics(mesh_size=0), "Numerics: mesh_size: is 0; give a number of at least 0.01"),
    (
        lambda: Numerics(grid=3),
        "Numerics: grid: unknown key; known are order, geometry_order, mesh_size",
    ),
    (lambda: Output(every=-1), "Output: every: is -1; give a number of at least 0"),
    *(
        (
            lambda choice=choice: Effects(inertia=choice),
            f'Effects: inertia: is {text}; give true or false or use "auto"',
        )
        for choice, text in (("maybe", '"maybe"'), (1, "1"), (None, "None"), (0.5, "0.5"))
    ),
    *(
        (
            lambda given=given: Disc(diameter=1, x=4.2, settle=given),
            f'Disc: settle: is {text}; give true or false or use "frictionless" or "level"',
        )
        for given, text in (("slide", '"slide"'), (1, "1"), (None, "None"))
    ),
    (
        lambda: Domain(length=1, height=1, sides="slip"),
        "Domain: sides: needs width, which is not given; add",
    ),
    (
        lambda: Domain(length=1, height=1, symmetric=True),
        "Domain: symmetric: needs width, which is not",
    ),
    (
        lambda: Domain(length=1, height=1, width=1, symmetric="no"),
        'Domain: symmetric: is "no"; give true or false or use "auto"',
    ),
    (
        lambda: Domain(length=1, height=1, width=1, origin=(1, 2)),
        "Domain: origin: has 2 items; give three, as",
    ),
    (
        lambda: Sphere(diameter=1),
        "Sphere: x: neither x nor centre is given; give x to rest on the bed",
    ),
    (
        lambda: Sphere(diameter=1, y=1, centre=(1, 1, 1)),
        "Sphere: y: goes with x, but centre is given; leave",
    ),
    (
        lambda: Cylinder(diameter=1, length=1, x=1),
        "Cylinder: x: a cylinder is fixed and does not rest on a bed; give",
    ),
    (
        lambda: Cylinder(diameter=1, length=1, centre=(1, 1, 1), motion="free", density=1),
        "Cylinder: motion: a cylinder across the flow is fixed",
    ),
    (
        lambda: Cylinder(diameter=1, length=1, centre=(1, 1, 1), orientation=(90, 0, 0)),
        "Cylinder: orientation: a cylinder lies across the flow; leave it out",
    ),
    (
        lambda: Sphere(diameter=1, x=5, inertia=(1, 3, 1)),
        "Sphere: inertia: has a moment that exceeds the sum of the others, as no distribution of mass has; reduce it",
    ),
    (
        lambda: Sphere(diameter=1, centre=(1, 1)),
        "Sphere: centre[2]: is missing; add it",
    ),
    (
        lambda: Box(sides=(1, 1, 1), edge_radius=0.6, x=1),
        "Box: edge_radius: edge_radius 0.6 is not between",
    ),
    (lambda: Polyhedron(vertices=((0, 0, 0),) * 4, x=1), "Polyhedron: vertices: "),
    (
        lambda: Spheres(spheres=((0, 0, 0),), x=1),
        "Spheres: spheres[0][3]: is missing; add it",
    ),
    (lambda: Spheres(spheres=((0, 0, 0, 1), (5, 0, 0, 1)), x=1), "Spheres: spheres: "),
    (lambda: Mesh(x=1), "Mesh: file: neither file nor vertices is given; give the name of an STL"),
    (
        lambda: Mesh(file="nothing.stl", x=1),
        "Mesh: file: nothing.stl cannot be read (No such file or directory); give the name",
    ),
    (
        lambda: Mesh(
            vertices=((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)), triangles=((0, 1, 2),), x=1
        ),
        "Mesh: triangles: the surface is not watertight",
    ),
    (
        lambda: SphereBed(radius=1, spacing=1),
        "SphereBed: spacing: 1 is less than two radii, 2: the spheres",
    ),
    (
        lambda: SphereBed(radius=1, spacing=4, layers=2),
        "SphereBed: layers: spheres so far apart carry no further",
    ),
    (
        lambda: SphereBed(radius=1, spacing=4, seed=1),
        "SphereBed: seed: is read only for a random arrangement",
    ),
    (
        lambda: HeapBed(),
        "HeapBed: file: neither file nor spheres is given; give the name of a CSV file",
    ),
    (
        lambda: HeapBed(file="none.csv"),
        "HeapBed: file: none.csv cannot be read (No such file or directory)",
    ),
    (
        lambda: HeapBed(spheres=()),
        "HeapBed: spheres: a bed of spheres has none; give one or more",
    ),
    (
        lambda: HeapBed(spheres=((0, 0, 0, -1),)),
        "HeapBed: spheres[0][3]: is -1; give a number greater than 0",
    ),
    (
        lambda: MeshBed(file="bed.png"),
        "MeshBed: file: bed.png cannot be read (No such file or directory); give the name of an STL",
    ),
    (
        lambda: HeightMapBed(),
        "HeightMapBed: file: neither file nor heights is given; give the name",
    ),
    (
        lambda: HeightMapBed(heights=((0, 0), (0,)), cell=(1, 1)),
        "HeightMapBed: heights: are in rows of different",
    ),
    (
        lambda: HeightMapBed(heights=((0, 0), (0, 0))),
        "HeightMapBed: cell: is missing; give the spacing",
    ),
]


FREE = {
    "body": Disc(diameter=1, centre=(4, 3), density=2, motion="free"),
    "time": Time(end=1, step=0.1),
}
MOVE = "move the grain, make it smaller or enlarge the domain"
BETWEEN = [
    (
        {"fluid": Fluid(scale="flow")},
        "fluid.reynolds: is missing; add it: V L / nu, V is the flow's velocity; or a section [units]",
    ),
    ({"gravity": Gravity()}, "gravity.acceleration: is missing; add it, or a section [units]"),
    (
        {"fluid": Fluid(scale="flow"), "body": None, "units": Units(diameter=1e-3, shear_rate=1)},
        "units: are those of a scene with a grain, and there is none; add",
    ),
    (
        {"body": Disc(diameter=1, centre=(4, 2), motion="free")},
        "body.density: a free grain needs a mass and a moment of inertia, which may be zero; give density",
    ),
    (
        {"body": Disc(diameter=1, x=4, inertia=1)},
        "body.inertia: is given without a mass; give density or mass as well, or leave it out",
    ),
    (
        {"flow": Lid()},
        'flow.kind: "lid" needs a box but the domain is a channel; set domain.kind = "box"',
    ),
    *[
        (
            {"domain": Domain(kind="box", length=12, height=6), "flow": flow},
            f'flow.kind: "{flow.kind}" needs open ends but a box is closed; '
            'set domain.kind = "channel", or use "lid" or "still"',
        )
        for flow in (Shear(), Poiseuille(), Uniform(), OpenChannel())
    ],
    (
        {"domain": Domain(kind="box", length=12, height=6, top="stream"), "flow": Still()},
        'domain.top: no flow passes the top of a closed box; use "wall", "slip" or "auto"',
    ),
    (
        {"domain": Domain(kind="box", length=12, height=6, top="slip"), "flow": Lid()},
        'domain.top: "slip" contradicts the flow "lid"; use "auto" or "wall"',
    ),
    (
        {"domain": Domain(length=12, height=6, top="wall"), "flow": OpenChannel()},
        'domain.top: "wall" contradicts the flow "open-channel"; use "auto", "slip", "stream" or "free-surface"',
    ),
    (
        {"body": None},
        'fluid.scale: "grain" but there is no grain; add a section [body] or use "flow"',
    ),
    (
        {"bed": None, "body": Disc(diameter=1, centre=(4, 2)), "contact": Contact(friction=0.5)},
        "contact.friction: friction needs a bed but there is none; "
        "add a section [bed] or leave [contact] out",
    ),
    (
        {"fluid": FLOW_SCALE, "body": None, "contact": Contact(friction=0.5)},
        "contact: contact needs a grain but there is none; add a section [body] or leave [contact] out",
    ),
    (
        {"bed": None},
        "body.x: the grain rests on a bed but there is none; add a section [bed], or give centre",
    ),
    (
        {"bed": Inclined(slope=3)},
        "bed.slope: a slope turns gravity but there is no gravity; add a section [gravity] or use",
    ),
    (
        {"flow": ExpressionFlow(components=("-y", "0"))},
        "flow.components: give a flow out of the left side, which is the inflow; mirror the scene",
    ),
    (
        {"flow": ExpressionFlow(components=("y*t", "0"))},
        "flow.components: depend on t but without [time] the flow is steady; "
        "add a section [time] or leave t out",
    ),
    (
        {"numerics": Numerics(convection="extrapolated")},
        'numerics.convection: "extrapolated" needs earlier steps but without [time] the flow is steady; '
        'add a section [time] or use "implicit"',
    ),
    *[
        (
            {"numerics": Numerics(**{key: value})},
            f"numerics.{key}: is read only for a grain that moves; leave it out or set body.motion",
        )
        for key, value in (
            ("interface_tolerance", 1e-6),
            ("remesh_below", 0.5),
        )
    ],
    (
        {"output": Output(every=2)},
        "output.every: counts time steps but without [time] the flow is steady; "
        "add a section [time] or leave it out",
    ),
    (
        {"bed": Polyline(points=[(0, 0), (5, 1)])},
        "bed: reaches from x = 0 to 5, the domain from 0 to 12; add points or shorten the domain",
    ),
    (  # gmsh could "not recover an edge"; in space all memory went into the estimate of cells
        {"domain": Domain(length=12, height=1e9)},
        "domain.height: is 1e+09, 1e+09 times the size of the grain; give at most 1e+06 times that size",
    ),
    (  # 233 TiB were asked for the ends of its cells
        {
            "domain": Domain(kind="box", length=1, height=1e12),
            "flow": Lid(),
            "fluid": FLOW_SCALE,
            "body": None,
            "bed": None,
        },
        "domain.height: is 1e+12, 1e+12 times the size of the smallest extent; give at most 1e+06 times",
    ),
    (  # the mesh had the lower side alone
        {"fluid": FLOW_SCALE, "body": None, "bed": Polyline(points=[(0, 1), (0, 0), (12, 0)])},
        "bed: has a step at x = 0, an end of the domain; leave out one of its two points, or move it inward",
    ),
    (  # the mesh had a ramp from end to end
        {
            "fluid": FLOW_SCALE,
            "body": None,
            "bed": Polyline(points=[(0, 0), (12, 0), (12, 1), (15, 1)]),
        },
        "bed: has a step at x = 12, an end of the domain; leave out one of its two points, or move it inward",
    ),
    (
        {"bed": Sinusoidal(amplitude=7, wavelength=4)},
        "bed: rises to y = 7, the top is at 6; enlarge domain.height or lower the bed",
    ),
    (
        {"bed": Polyline(points=[(0, 0), (4.0001, 0), (4.0002, 6.5), (4.0003, 0), (12, 0)])},
        "bed: rises to y = 6.5, the top is at 6; enlarge domain.height or lower the bed",
    ),
    (
        {"fluid": FLOW_SCALE, "body": None, "bed": None, "flow": Shear(datum="mean")},
        "flow.datum: is a height of the bed but there is none; add a section [bed] or leave it out",
    ),
    (
        {"bed": HalfDiscs(radius=0.5, spacing=1.2), "flow": Poiseuille(datum=0.6)},
        "flow.datum: is 0.6, the bed's heights above its base line go from 0 to 0.5; give one of them, or",
    ),
    (
        {"domain": Domain(length=12, height=6, origin=(0, 5)), "flow": Uniform(datum=-0.1)},
        "flow.datum: is -0.1, the bed's heights above its base line go from 0 to 0; give one of them, or",
    ),
    (
        {
            "domain": Domain(length=12, height=1),
            "bed": Sinusoidal(amplitude=1, wavelength=80, phase=-90),
        },
        "bed: rises to y = 1, the top is at 1; enlarge domain.height or lower the bed",
    ),
    (
        {"body": Disc(diameter=1, x=0.2)},
        f"body.x: the grain reaches x = -0.3, the domain's left side is at 0; {MOVE}",
    ),
    (
        {"body": Disc(diameter=1, x=11.5)},
        f"body.x: the grain reaches x = 12, the domain's right side is at 12; {MOVE}",
    ),
    (
        {
            "body": Rectangle(width=1, height=5, x=4, angle=30),
            "domain": Domain(length=12, height=4),
        },
        "domain.height: is 4, too little for the grain, which takes 4.83013; enlarge it",  # 5 cos 30 + sin 30
    ),
    (
        {"contact": Contact(friction=0.5, tolerance=1e-17)},
        "contact.tolerance: is 1e-17, a distance of 1e-17, but numbers in the domain are 1.8e-15 apart; give a larger",
    ),
    ({"body": Disc(diameter=1, x=40)}, f"body.x: x = 40 is outside the domain, 0 to 12; {MOVE}"),
    (
        {"body": Disc(diameter=1, x=1e29)},
        f"body.x: x = 1e+29 is outside the domain, 0 to 12; {MOVE}",
    ),
    (
        {"body": Disc(diameter=1e20, x=4)},
        f"body.x: the grain measures 1e+20, more than the domain; {MOVE}",
    ),
    (
        {"body": Disc(diameter=1, centre=(4, 5.6))},
        f"body.centre: the grain reaches y = 6.1, the domain's top is at 6; {MOVE}",
    ),
    (
        {"body": Disc(diameter=1, centre=(4, 0.4)), "bed": None},
        f"body.centre: the grain reaches y = -0.1, the domain's lower side is at 0; {MOVE}",
    ),
    (
        {"body": Disc(diameter=1, centre=(4, 0.5))},
        "body.centre: the grain touches the bed above which centre holds it; raise the grain, or give x to let",
    ),
    (
        {"body": Disc(diameter=1, centre=(4, 0.5 + 1e-8))},
        "body.centre: the grain touches the bed above which centre holds it; raise the grain, or give x to let",
    ),
    (
        {
            "body": Disc(
                diameter=1, centre=(4, 0.503), motion="free", on_contact="touch", density=2
            ),
            "time": Time(end=1.0, step=0.1),
            "contact": Contact(friction=0.5),
        },
        "body.centre: the grain starts 0.003 from the bed, within contact.gap; raise the grain, or give x",
    ),
    *[
        (
            {"body": Disc(diameter=1, centre=centre), "bed": None},
            f"body.centre: the grain nearly touches the domain's {side}, from which it is 0.0005; {MOVE}",
        )
        for side, centre in (
            ("left side", (0.5005, 3)),
            ("right side", (11.4995, 3)),
            ("top", (4, 5.4995)),
            ("lower side", (4, 0.5005)),
        )
    ],
    (
        {"body": Disc(diameter=1, x=0.5005)},
        f"body.x: the grain nearly touches the domain's left side, from which it is 0.0005; {MOVE}",
    ),
    (
        {"body": Disc(diameter=1, centre=(4, 0.3))},
        "body.centre: the grain reaches 0.2 into the bed; raise the grain, or give x to let it rest",
    ),
    (
        {
            "body": Disc(diameter=1, centre=(4, 2)),
            "bed": Polyline(points=[(0, 0), (3.99, 0), (4, 2), (4.01, 0), (12, 0)]),
        },
        "body.centre: the grain reaches",
    ),
    (
        {"body": Disc(diameter=1, centre=(4, -3))},
        "body.centre: the grain reaches 3.5 into the bed; raise the grain, or give x to let it rest",
    ),
    *(
        (
            {"domain": Domain(length=12, height=6, origin=corner)},
            "domain.origin: is so large that numbers",
        )
        for corner in ((1e12, 0.0), (0.0, -1e15))
    ),
    (
        {"effects": Effects(unsteadiness=True)},
        "effects.unsteadiness: is true but without [time] the flow is steady; add a section",
    ),
    (
        {
            "effects": Effects(inertia=True),
            "fluid": Fluid(reynolds=1, scale="grain", inertia=False),
        },
        "effects.inertia: is true but fluid.inertia = false; leave one of them out",
    ),
    (
        {"effects": Effects(gravity=True)},
        "effects.gravity: is true but there is no gravity; add a section",
    ),
    (
        {"effects": Effects(contact=True), **FREE},
        "effects.contact: is true but no grain rests on a bed; add [bed], and [body] with",
    ),
    (
        {"effects": Effects(unsteadiness=False), **FREE},
        "effects.unsteadiness: is false but a grain moves in time; use",
    ),
    (
        {"effects": Effects(unsteadiness=False), "time": Time(end=1, step=0.1, tolerance=1e-3)},
        "effects.unsteadiness: is false but steps adapt to the rate of change; leave time.tolerance out",
    ),
    ({"flow": {"kind": "log-law", "roughness": -1}}, "flow.roughness: is -1"),
    (
        {"flow": LogLaw(roughness=30.0)},
        "flow.roughness: is 600 times nu/u*; the mean profile is known up to 500",
    ),
    (
        {"flow": LogLaw(), "domain": Domain(length=12, height=6, top="wall")},
        'domain.top: "wall" contradicts the flow "log-law"; use "auto", "stream" or "slip"',
    ),
    (
        {"flow": LogLaw(), "domain": Domain(length=12, height=6, kind="box")},
        'flow.kind: "log-law" needs open ends but a box is closed',
    ),
    ({"flow": LogLaw(datum=0.7), "bed": HalfDiscs(radius=0.5, spacing=1.2)}, "flow.datum: "),
    ({"domain": 3}, "domain: is 3; write a section [domain]"),
    ({"flow": DISC}, "flow.kind: is missing; use "),
    ({"fluid": CHANNEL}, "fluid: is a Domain; write a section [fluid]"),
    (
        {
            "body": Rectangle(width=1, height=0.5, x=4, settle=True),
            "bed": Inclined(slope=20),
            "gravity": Gravity(acceleration=10),
            "contact": Contact(friction=0.3),
        },
        "body.x: the grain rolls off: it leaves the bed, or its surroundings, before it finds a rest; "
        "change x or angle, or leave settle out",
    ),
    (
        {"body": Ellipse(semi_axes=(0.6, 0.4), x=4, angle=90, settle=True)},
        "body.x: the grain balances: the least disturbance makes it fall; change x or angle, or leave settle out",
    ),
    (  # started beside the inflow it rests with its left side beyond it
        {"body": Ellipse(semi_axes=(0.6, 0.4), x=0.3, settle=True)},
        f"body.x: the grain reaches x = -0.3, the domain's left side is at 0; {MOVE}",
    ),
]
IN_SPACE = [
    (
        {"domain": Domain(length=12, height=6)},
        'body.shape: domain.width is missing, which the three-dimensional "sphere" needs; '
        "add domain.width, or use a two-dimensional body",
    ),
    (
        {"body": Disc(diameter=1, x=5)},
        'body.shape: "disc" is two-dimensional, but domain.width makes',
    ),
    ({"bed": HalfDiscs(radius=0.5, spacing=1)}, 'bed.kind: "half-discs" is two-dimensional, but'),
    ({"flow": ExpressionFlow(components=("y", "0"))}, "flow.components: has 2 items; give three"),
    (
        {"flow": Shear(datum="effective")},
        'flow.datum: is "effective" in 3-D, where it is not computed; use "auto"',
    ),
    (
        {"body": Sphere(diameter=1, x=5, y=8.5)},
        "body.y: y = 8.5 is outside the domain, 0 to 8; move",
    ),
    (
        {"body": Sphere(diameter=1, x=5, y=7.8)},
        "body.y: the grain reaches y = 8.3, the domain's side at largest y",
    ),
    ({"body": Sphere(diameter=1, x=0.2)}, "body.x: the grain reaches x = -0.3"),
    (
        {"body": Sphere(diameter=7, x=5)},
        "domain.height: is 6, too little for the grain, which takes 7; enlarge it",
    ),
    (
        {"domain": Domain(length=12, width=0.9, height=6)},
        "domain.width: is 0.9, too little for the grain, which takes 1; enlarge it, or make",
    ),
    (
        {"body": Sphere(diameter=1, centre=(5, 4, 0.3))},
        "body.centre: the grain reaches 0.2 into the bed; raise",
    ),
    (
        {"body": Sphere(diameter=1, centre=(5, 4, 5.8))},
        "body.centre: the grain reaches z = 6.3, the domain's top",
    ),
    (
        {"body": Cylinder(diameter=1, length=7, centre=(5, 4, 3))},
        "body.length: the cylinder reaches from y = 0.5 to 7.5, the domain from 0 to 8; give domain.width",
    ),
    (
        {"bed": SphereBed(radius=7, spacing=14)},
        "bed: rises to z = 7, the top is at 6; enlarge domain.height",
    ),
    (
        {"bed": HeightMapBed(heights=((0.0, 0.1), (0.0, 0.1)), cell=(4.0, 8.0))},
        "bed: reaches from x = 0 to 4, the domain from 0 to 12; enlarge its cell",
    ),
    (
        {"bed": SphereBed(radius=0.5, spacing=1, slope=10)},
        "bed.slope: a slope turns gravity but there is no",
    ),
    (
        {"domain": Domain(length=1e20, width=8, height=6)},
        "domain.length: is so large that numbers there are",
    ),
    (
        {
            "flow": ExpressionFlow(components=("1/(1.2 - x)", "0", "0")),
            "domain": Domain(length=12, width=8, height=6, symmetric=True),
        },
        'domain.symmetric: flow.components[0]: "1/(1.2 - x)" is inf at x = 1.2, y = 4, z = 0, t = 0; give a formula',
    ),
]


def of_scenes(make, rows):
    return [(partial(make, **changes), f"Scene: {text}") for changes, text in rows]


# Scenes with an effect that keys of other sections contradict: in each a section or a key is another.


IN_TIME = {"end": 1.0, "step": 0.1}
FLUID = {"reynolds": 20.0, "scale": "flow"}
OSCILLATION = {
    "domain": {"length": 4.0, "height": 6.0},
    "fluid": FLUID,
    "flow": {"kind": "oscillatory", "period": 6.0},
    "time": IN_TIME,
}
GUST = {
    "domain": {"length": 4.0, "height": 4.0},
    "fluid": FLUID,
    "flow": {"kind": "shear", "gust": {"duration": 0.2}},
    "time": IN_TIME,
}
FILM = {
    "domain": {"length": 3.0, "height": 1.0, "top": "free-surface"},
    "fluid": FLUID,
    "flow": {"kind": "open-channel"},
    "gravity": {"acceleration": 1.0},
    "surface": {"elevation": "0"},
    "time": IN_TIME,
}
WAVE = {
    **FILM,
    "domain": {"kind": "box", "length": 1.0, "height": 1.0, "top": "free-surface"},
    "flow": {"kind": "still"},
    "surface": {"elevation": "0.01*cos(pi*x)", "stations": [0.0, 0.3, 1.0], "bottom": "slip"},
}
RELEASED = {
    "domain": {"length": 8.0, "height": 4.0},
    "fluid": {"reynolds": 20.0, "scale": "grain"},
    "flow": {"kind": "shear"},
    "bed": {"kind": "half-discs", "radius": 0.5, "spacing": 1.0},
    "body": {"shape": "disc", "diameter": 1.0, "x": 3.5, "density": 1.5, "motion": "released"},
    "gravity": {"acceleration": 1.0},
    "contact": {"friction": 0.6},
    "time": {**IN_TIME, "start": "steady"},
}
RESTING = {
    **RELEASED,
    "bed": {"kind": "flat"},
    "body": {"shape": "disc", "diameter": 1.0, "x": 4.0, "density": 2.65},
    "time": None,
}
AWAY_FROM_WALLS = {
    "domain": {"length": 8.0, "height": 4.0},
    "fluid": {"reynolds": 20.0, "scale": "grain"},
    "flow": {"kind": "uniform"},
    "body": {"shape": "disc", "diameter": 1.0, "centre": [3.0, 2.0]},
}
TOGETHER = [
    *(
        (RESTING, {"numerics.accuracy": value}, f"numerics.accuracy: is {words}")
        for value, words in (
            (0, '0; give a number of at least 1e-05 or use "verdict"'),
            (-0.1, '-0.1; give a number of at least 1e-05 or use "verdict"'),
            (1e-7, '1e-07; give a number of at least 1e-05 or use "verdict"'),
            (1, '1; give a number less than 1 or use "verdict"'),
            (True, 'true; give a number or use "verdict"'),
            ("high", '"high"; give a number or use "verdict"'),
        )
    ),
    (
        RESTING,
        {"numerics.budget_seconds": 5},
        "numerics.budget_seconds: limits what is spent on an accuracy but none is requested; add numerics.accuracy",
    ),
    (
        RESTING,
        {"numerics.accuracy_includes": "all"},
        "numerics.accuracy_includes: says what an accuracy includes but none is requested; add numerics.accuracy",
    ),
    (
        RESTING,
        {"numerics.accuracy": 0.01, "numerics.accuracy_of": "drag"},
        'numerics.accuracy_of: "drag" is not known; use "auto", "force"',
    ),
    (
        RESTING,
        {"time": IN_TIME, "numerics.accuracy": "verdict"},
        'numerics.accuracy: "verdict" is for steady flow; give a number, or leave [time] out',
    ),
    (
        RESTING,
        {"flow.kind": "still", "numerics.accuracy": 0.01},
        "numerics.accuracy: is relative but a fluid at rest exerts no force; leave it out",
    ),
    (
        {"domain": {"kind": "box", "length": 1.0, "height": 1.0}, "fluid": FLUID},
        {"flow.kind": "lid", "numerics.accuracy": 0.01},
        "numerics.accuracy: needs a grain or a free surface but there is neither; add a section [body]",
    ),
    *(
        (
            AWAY_FROM_WALLS,
            changes,
            f"numerics.{key} needs a grain that rests on a bed, its density and friction; give body.x",
        )
        for key, changes in (
            ("accuracy: a verdict", {"numerics.accuracy": "verdict"}),
            (
                "accuracy_of: a safety factor",
                {"numerics.accuracy": 0.01, "numerics.accuracy_of": "safety factor"},
            ),
        )
    ),
    (OSCILLATION, {"time": None}, 'flow.kind: "oscillatory" changes in time'),
    (OSCILLATION, {"time.step": 1.0}, "time.step: is 1, more than 1/8 of flow.period; reduce it"),
    (OSCILLATION, {"time.start": "steady"}, "time.start: is not read with flow.kind"),
    (OSCILLATION, {"time.until_steady": 0.1}, "time.until_steady: is for a steady flow but"),
    (OSCILLATION, {"effects.unsteadiness": False}, "effects.unsteadiness: is false, but without"),
    (OSCILLATION, {"domain.top": "slip"}, 'domain.top: "slip" contradicts the flow "oscillatory"'),
    (OSCILLATION, {"domain.kind": "box"}, 'flow.kind: "oscillatory" needs open ends but'),
    (OSCILLATION, {"flow.period": -1}, "flow.period: is -1; give a number greater than 0"),
    (
        OSCILLATION,
        {"domain.width": 2.0, "domain.sides": "wall"},
        'domain.sides: "wall" contradicts the flow "oscillatory"',
    ),
    (GUST, {"time": None}, "flow.gust: changes the flow in time"),
    (GUST, {"time.step": 0.2}, "flow.gust.duration: is 0.2, less than 2 time steps of 0.2"),
    (GUST, {"effects.turbulence": True}, "flow.gust: with turbulence is not simulated"),
    (GUST, {"flow.gust": {"shape": "points"}}, "flow.gust.file: neither file nor points is given"),
    (
        GUST,
        {"flow.gust": {"shape": "points", "points": [[0, 1], [1, 2]], "strength": 3.0}},
        'flow.gust.strength: is not read with shape = "points"',
    ),
    (
        GUST,
        {"flow.gust": {"shape": "points", "file": "absent.csv"}},
        "flow.gust.file: absent.csv cannot be read (No such file or directory); give the name of a CSV file of time, f",
    ),
    (GUST, {"flow.gust": {"rise": 3.0}}, "flow.gust.rise: is 3, more than the duration"),
    (
        GUST,
        {"flow.gust": {"points": [[0, 1], [1, 2]]}},
        'flow.gust.points: are not read with shape = "top-hat"',
    ),
    (
        GUST,
        {"time.until_steady": 1e-3},
        "time.until_steady: is for a steady flow but flow.gust changes it",
    ),
    (
        FILM,
        {"flow.kind": "shear"},
        'flow.kind: "shear" is not possible below a free surface, which has no shear; use "open',
    ),
    (
        FILM,
        {"surface.outflow": "wall"},
        'flow.kind: "open-channel" needs an open outflow but surface.outflow is',
    ),
    (
        FILM,
        {"surface.sponge": 2.0},
        "surface.sponge: is 2, more than half of the channel; give at most 1.5",
    ),
    (FILM, {"domain.width": 1.0, "domain.sides": "stream"}, 'domain.sides: is "stream", which'),
    (
        FILM,
        {"time.until_steady": 1e-3, "surface.wave": {"amplitude": 0.01, "period": 4.0}},
        "time.until_steady: is for a steady flow but surface.wave is unsteady",
    ),
    (
        FILM,
        {"time.until_steady": 1e-3, "flow.kind": "still"},
        "time.until_steady: is for a flow but the fluid is still",
    ),
    (
        WAVE,
        {"surface.sponge": 1.0},
        "surface.sponge: is read only in a channel but the domain is a box",
    ),
    (WAVE, {"gravity": None}, "domain.top: a free surface needs gravity; add"),
    (
        WAVE,
        {"surface.stations": [1.5]},
        "surface.stations[0]: x = 1.5 is outside the domain",
    ),
    (
        WAVE,
        {"surface.stations": [[0.5, 0.5]]},
        "surface.stations[0]: has 2 coordinates; give its x",
    ),
    (
        WAVE,
        {"surface.elevation": "-2*x"},
        "surface.elevation: brings the surface down to the bed at x = ",
    ),
    # The surface is at y = 0.9919 above its centre, its top at 0.995.
    (
        WAVE,
        {"body": {"shape": "disc", "diameter": 0.2, "centre": [0.8, 0.895]}},
        "surface.elevation: brings the surface down to the grain; give a smaller elevation, or lower",
    ),
    (WAVE, {"surface.elevation": "1/x"}, 'surface.elevation: "1/x" is inf at'),
    (
        WAVE,
        {"surface.elevation": "0.1*y"},
        "surface.elevation: depends on y but the scene is two-dimensional",
    ),
    (
        WAVE,
        {"numerics.accuracy": "verdict"},
        'numerics.accuracy: "verdict" needs a grain but there is none; add a section [body] or give a number',
    ),
    (
        WAVE,
        {"numerics.accuracy": 0.01, "numerics.accuracy_of": "force"},
        'numerics.accuracy_of: "force" needs a grain but there is none; add a section [body] or use "elevation"',
    ),
    (
        WAVE,
        {"numerics.accuracy": 0.01, "numerics.accuracy_of": "torque"},
        'numerics.accuracy_of: "torque" needs a grain but there is none; add a section [body] or use "elevation"',
    ),
    (
        WAVE,
        {"domain.top": "slip", "surface": None, "numerics.accuracy": 0.01},
        "numerics.accuracy: needs a grain or a free surface but there is neither; add a section [body]",
    ),
    (
        AWAY_FROM_WALLS,
        {"numerics.accuracy": 0.01, "numerics.accuracy_of": "elevation"},
        'numerics.accuracy_of: "elevation" needs a free surface but there is none',
    ),
    (
        FILM,
        {
            "domain.width": 1.0,
            "domain.sides": "wall",
            "surface.wave": {"amplitude": 0.01, "period": 4.0},
        },
        "surface.wave: is two-dimensional but the channel has no-slip sides",
    ),
    (
        WAVE,
        {"time.start": "steady"},
        "time.start: below a free surface the fluid of a box starts",
    ),
    (RELEASED, {"contact": None}, "contact.friction: is missing"),
    (RELEASED, {"time": None}, "body.motion: a moving grain needs time steps"),
    (RELEASED, {"body.locked": ["x"]}, "body.locked: is read only with"),
    (
        RELEASED,
        {"body.centre": [3.5, 2.0], "body.x": None},
        "body.centre: a released grain starts from its rest",
    ),
    (
        RELEASED,
        {"contact.kinetic_friction": 0.7},
        "contact.kinetic_friction: is 0.7, more than contact.friction = 0.6",
    ),
    (RELEASED, {"time.tolerance": 1e-3}, "time.tolerance: but velocities jump"),
    (
        RELEASED,
        {"body.motion": "fixed", "time.until": "at-rest"},
        "time.until: is read only with",
    ),
    (
        RELEASED,
        {"body.motion": "fixed", "contact.restitution": 0.5, "time": None},
        "contact.restitution: is read only",
    ),
    (RELEASED, {"effects.contact": False}, "effects.contact: is false"),
    (
        RELEASED,
        {"bed": {"kind": "flat"}, "time.until": "out-of-pocket"},
        'time.until: "out-of-pocket" but the bed is flat',
    ),
]


def with_others(sections, changes):
    plain = copy.deepcopy(sections)
    for path, value in changes.items():
        section, _, name = path.partition(".")
        if name:
            plain.setdefault(section, {})[name] = value
        else:
            plain[section] = value
    return Scene(**plain)


ROWS = [
    *ONE_KEY,
    *of_scenes(scene, BETWEEN),
    *of_scenes(sphere_on_plane, IN_SPACE),
    *((partial(with_others, *row), f"Scene: {text}") for *row, text in TOGETHER),
]


def test_escape_sequences_in_messages_are_shown_escaped(capsys):
    """Of an unknown key in a scene from elsewhere."""
    say(message(lambda: loads('"\\u001b[2J" = 1')))
    assert "\\x1b[2J: unknown key" in capsys.readouterr().err


@pytest.mark.parametrize(("build", "expected"), ROWS, ids=[text[:70] for _, text in ROWS])
def test_what_is_wrong_is_said(build, expected):
    assert message(build).startswith(expected)


def test_several_errors_are_shown():
    result = message(lambda: Domain(kind="sphere", length=-1, heigth=2))
    first = (
        'Domain: heigth: unknown key; did you mean "height"? (and 3 more errors: kind: "sphere" is '
    )
    assert result.startswith(first) and " | length: is -1; give a number greater than 0 |" in result
    result = message(lambda: scene(flow=Lid(), output=Output(every=2)))
    assert 'set domain.kind = "box" (and 1 more error: output.every: ' in result
    result = message(lambda: Domain(**{f"k{n}": 1 for n in range(20)}))  # type: ignore[arg-type]
    assert "more errors" in result and "k4" in result and "k5" not in result


# -- retired keys and values -------------------------------------------------------------------------


RETIRED = [
    *((key, "1", f"{key}: is retired; {remedy}") for key, remedy in messages.RETIRED.items()),
    *(
        (key, value, f'{key}: "{value}" is retired; {remedy}')
        for (key, value), remedy in messages.RETIRED_VALUES.items()
    ),
    ("flow.kind", "vortex", 'flow.kind: "vortex" is retired; use flow.kind = "shear"'),
    ("flow.datum", "wall", 'flow.datum: "wall" is retired; use flow.kind = "shear"'),
]


@pytest.mark.parametrize(("key", "value", "expected"), RETIRED)
def test_what_is_retired_names_what_to_write(key, value, expected, monkeypatch):
    for old in (("flow.kind", "vortex"), ("flow.datum", "wall")):
        monkeypatch.setitem(messages.RETIRED_VALUES, old, 'use flow.kind = "shear"')
    said = message(lambda: loads(example(), overrides=[f"{key}={value}"]))
    assert said.partition(" (and")[0].endswith(expected)
