"""The physical effects of a scene, one folder or file each; everything else walks their list."""
