"""Pictures of what a directory holds, drawn off screen by matplotlib and pyvista."""
