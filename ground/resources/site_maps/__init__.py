"""Site maps."""
