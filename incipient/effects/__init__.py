"""Physical effects of a scene, listed in `known`."""
