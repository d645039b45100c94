"""Tests of terrain from pictures."""
