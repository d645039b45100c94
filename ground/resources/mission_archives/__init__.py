"""Missions as archives and as copies."""
