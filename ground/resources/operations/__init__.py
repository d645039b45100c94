"""How the service fares now, for who administers it."""
