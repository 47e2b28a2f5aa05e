"""A free surface on the fluid."""
