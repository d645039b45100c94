"""Rows, queries and product files of the Ground Data Repository."""
