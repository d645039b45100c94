"""Calibrations of a mission's path network."""
