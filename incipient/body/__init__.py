"""The rigid grain: state, mass, motion, and the integrator that advances it."""
