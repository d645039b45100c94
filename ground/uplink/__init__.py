"""Uplink packages, the keys that sign them, and their execution without the ground."""
