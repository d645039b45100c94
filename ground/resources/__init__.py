"""One folder a noun: value, rules, row, kind, use cases, routes."""
