"""Formats and programs of those who work with places and data: SPICE, STAC, PDS4, glTF, OGC."""
