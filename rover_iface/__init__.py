"""The rover as the executive sees it, and the rover itself, simulated."""
