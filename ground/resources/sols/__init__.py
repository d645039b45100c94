"""Sols."""
