"""Commands that drive through the simulated world."""
