"""Retired keys and values of scenes, with their remedies."""

# Dotted key -> remedy; indices of lists are left out of the key.
KEYS: dict[str, str] = {
    "effects.free_body": 'leave it out, and set body.motion = "free" or "fixed"',
    "effects.free_surface": 'leave it out, and set domain.top = "free-surface" or "slip"',
    "effects.moving_mesh": "leave it out: the mesh moves with the grain and the free surface",
    "effects.third_dimension": "leave it out: domain.width makes a scene three-dimensional",
    "numerics.coupling": "leave it out: grain and fluid are coupled with the grain's added mass",
    "numerics.form": "leave it out: the convective term is the paper's",
    "surface.ends": "leave it out: the fluid slides along both ends of a box",
    "surface.inflow": "use surface.wave, or a flow.kind whose velocity is steady",
    "surface.pressure": "leave it out: the pressure above the surface is the same everywhere",
    "surface.seepage": "leave it out: nothing crosses the bed",
    "surface.tension": "leave it out: the surface is that of water deeper than some millimetres",
    "surface.wave.zone": "make the domain longer ahead of the grain, so that reflected waves come late",
    "bed.leading_edge": "leave it out: plates in a turbulent flow are no longer simulated",
    "bed.diameters": 'give sizes and spread, or kind = "spheres" with a file of the spheres',
    "turbulence.first_cell": "use numerics.mesh_size, which scales all cells",
}

# (Dotted key, value) -> remedy.
VALUES: dict[tuple[str, str], str] = {
    ("body.on_contact", "repel"): 'use "touch": the grain then rolls, slides or rests on the bed',
    ("numerics.accuracy_of", "couple"): 'use "torque"',
    ("gusts.microscale", "model"): "give a number: sqrt(20 nu k/epsilon) over the mean velocity",
    ("gusts.integral_time", "model"): "give a number: 0.43 k^1.5/epsilon over the mean velocity",
}
