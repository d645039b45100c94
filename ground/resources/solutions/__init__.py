"""Localization solutions."""
