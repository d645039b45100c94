"""A mission's terrain and products as a STAC catalogue."""
