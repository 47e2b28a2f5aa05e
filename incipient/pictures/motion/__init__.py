"""Pictures of what moves: paths of grains, films of a run, a film around a grain."""
