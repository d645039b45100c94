"""Packages outside the product."""
