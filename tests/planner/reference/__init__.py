"""Independent truth on small problems, written from their definition in docs/reference/planner.md alone."""
