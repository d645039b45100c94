"""Attackers against the uplink: a generator of scripts, and an oracle that knows what people signed."""
