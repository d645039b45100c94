"""Terrains."""
