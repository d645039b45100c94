"""The service: the parts joined, and what every request passes."""
