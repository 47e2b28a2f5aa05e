"""Error bars of a result, and meshes refined to a requested accuracy."""
