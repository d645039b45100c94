"""A module of a package that fails while it is imported."""

Tracker = 1 // 0
