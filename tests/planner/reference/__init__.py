"""Independent truth about small problems, written from their definition in docs/planner.md alone."""
