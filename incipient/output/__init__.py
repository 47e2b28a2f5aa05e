"""Everything that leaves a run: fields for ParaView, tables, results."""
