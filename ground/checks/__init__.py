"""Checks of a plan before anybody is asked to approve it: flight rules, and all of them as one report.

Nothing here knows a database or a web framework.
"""
