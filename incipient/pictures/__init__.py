"""Pictures of what a directory holds, drawn off screen: no X server is needed.

matplotlib paints the quadratic cells, subdivided, with their curved boundaries, and judged 2-D grains;
pyvista shows the mesh, and judged 3-D grains.
"""
