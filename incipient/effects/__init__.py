"""Physical effects of a scene, a folder or file each, listed in `known`."""
