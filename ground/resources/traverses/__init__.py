"""Traverses."""
