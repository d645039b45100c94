"""The simulated rovers, renderer and faults."""
