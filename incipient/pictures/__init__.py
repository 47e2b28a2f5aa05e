"""Pictures of what a directory holds, drawn off screen: no X server is needed.

matplotlib paints the quadratic cells, subdivided, with their curved boundaries, and judged grains in the plane;
pyvista shows the mesh, and judged grains in space.
"""
