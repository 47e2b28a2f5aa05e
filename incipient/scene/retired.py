"""Keys and values that scenes no longer have, and what to write instead."""

# Dotted key -> remedy; indices of lists are left out of the key.
KEYS: dict[str, str] = {
    "bed.leading_edge": "leave it out: plates in a turbulent stream are no longer simulated",
    "turbulence.first_cell": "use numerics.mesh_size, which scales all cells",
}

# (Dotted key, value) -> remedy.
VALUES: dict[tuple[str, str], str] = {}
