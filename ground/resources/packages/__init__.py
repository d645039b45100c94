"""Uplink packages."""
