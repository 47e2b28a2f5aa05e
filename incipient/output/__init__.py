"""Output of a run: fields for ParaView, tables, results."""
