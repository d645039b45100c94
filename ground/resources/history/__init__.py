"""A mission's history."""
