"""Frames of the site chain."""
