"""Branches for plans grown on sampled futures: futures, conditions, endings, polish, and lines raced."""
