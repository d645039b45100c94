"""Sols that follow each other: a plan for the first, an outline for the later ones, and a bound."""
