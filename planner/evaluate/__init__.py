"""The value of a plan tree: grid propagation and Monte Carlo."""
