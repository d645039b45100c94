"""The demo: a mission made from a seed, and its day from end to end."""
