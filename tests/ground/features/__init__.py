"""OGC API Features and CQL2."""
