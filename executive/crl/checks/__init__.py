"""What a validator must reject, or doubt, about a plan: one module for each idea."""
