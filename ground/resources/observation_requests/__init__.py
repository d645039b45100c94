"""Observation requests."""
