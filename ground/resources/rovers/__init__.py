"""Rovers by name, as their profiles and dictionaries say."""
