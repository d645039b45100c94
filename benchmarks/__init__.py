"""Checks of speed and size that have a threshold; run by name: `python -m benchmarks.stn`."""
