"""The CRL language and the event-driven executive that runs it; depends on no rover, planner or database."""
