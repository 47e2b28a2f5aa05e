"""What follows from a scene before anything is decided or meshed: geometry, base flow, dimensionless numbers."""
