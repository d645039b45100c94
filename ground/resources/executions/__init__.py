"""Packages executed on the training rover of a mission, and the sol that comes after."""
