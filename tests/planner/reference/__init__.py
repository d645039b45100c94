"""Independent truth about small problems, written from their definition in docs/reference/planner.md alone."""
