"""New missions."""
