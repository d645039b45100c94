"""Hazard map and arcs."""
