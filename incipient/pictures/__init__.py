"""Pictures of results, drawn off screen by matplotlib and pyvista."""
