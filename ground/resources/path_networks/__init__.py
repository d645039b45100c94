"""Path networks."""
