"""Webhooks: the events of a mission told to a server elsewhere, signed."""
