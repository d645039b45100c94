"""Orders that make one observation at whatever cost, and the smallest changes that let it in."""
