"""The rigid grain: its state, mass and motion, and the integrator that advances it."""
