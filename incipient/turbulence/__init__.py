"""Models of the mean flow: walls, inflow, equations, and their solution together with the flow."""
