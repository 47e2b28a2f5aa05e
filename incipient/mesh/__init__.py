"""The mesh in use: domain, motion, location of points, transfer to another mesh."""
