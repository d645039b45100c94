"""Long work as rows with a lease, and the worker that does it on an Executor."""
