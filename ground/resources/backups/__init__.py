"""Backups of the whole repository."""
