"""Parts of the plan of a scene: base flow, boundary conditions, meshed geometry and cell sizes."""
