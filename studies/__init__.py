"""Reproductions of papers and measurements, run by name; figures of their last runs lie in `results`."""
