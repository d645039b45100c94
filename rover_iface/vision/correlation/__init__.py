"""Targets followed by correlation: the tracker, what it keeps of a target, what it believes a match by."""
