"""Pictures of a grain and what is judged of it: traction, load, contact forces, threshold, series."""
