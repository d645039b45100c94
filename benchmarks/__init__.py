"""Checks of speed, size and quality against limits; `scripts/bench` runs them."""
