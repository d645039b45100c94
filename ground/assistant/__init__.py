"""A server of tools for assistants (MCP) over the client: they read and draft, and do nothing else."""
