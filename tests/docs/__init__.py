"""Tests of the documentation: its snippets, its words, and whether a newcomer finds answers."""
