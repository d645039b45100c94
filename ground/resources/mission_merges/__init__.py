"""What differs between a mission and its copy, and the one merged into the other."""
