"""Merge bases: the state of another mission that a mission holds, by a copy or a merge."""
