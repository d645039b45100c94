"""Versions of one plan: what differs between two by meaning, and the three-way merge of two edits of a third.

Nothing here knows a database or a web framework.
"""
