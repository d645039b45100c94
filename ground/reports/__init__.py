"""Pages and drawings for people. Pure: no repository."""
