"""Runs of a scene: state and procedure, steady and in time, to the result."""
