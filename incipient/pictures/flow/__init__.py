"""Pictures of the flow: its fields in the plane or in a section, its cells, its surface, its walls."""
