"""The mesh in use: domain and named boundaries, motion with a grain, location of points, transfer to another mesh."""
