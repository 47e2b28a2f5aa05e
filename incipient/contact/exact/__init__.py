"""Rigid-body mechanics with Coulomb friction at contact points: the second of two judges."""
