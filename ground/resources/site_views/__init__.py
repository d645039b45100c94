"""Views from the rover."""
