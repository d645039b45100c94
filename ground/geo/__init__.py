"""Where a site lies on a body, and its metres in the references of others. A leaf: mathematics by pyproj."""
