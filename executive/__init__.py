"""The CRL language and the event-driven executive that runs it; knows no rover, planner or database."""
