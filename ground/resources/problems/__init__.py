"""Planning problems."""
