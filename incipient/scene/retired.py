"""Keys and values that scenes no longer have, and what to write instead."""

# Dotted key -> remedy; indices of lists are left out of the key.
KEYS: dict[str, str] = {}

# (Dotted key, value) -> remedy.
VALUES: dict[tuple[str, str], str] = {}
