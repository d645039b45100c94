"""What executions bring down, and how it is taken in."""
