"""Commands for who looks after a service."""
