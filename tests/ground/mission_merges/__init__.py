"""Merges of missions."""
