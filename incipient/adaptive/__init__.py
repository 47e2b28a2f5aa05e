"""Runs to an accuracy: meshes, orders and steps of the program's choice."""
