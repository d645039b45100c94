"""The work of jobs: pure functions of a payload, importable by name in another process."""
