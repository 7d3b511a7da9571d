"""Costs: moved between spaces, on the centre of mass, and as tasks (§3 of the document)."""
