"""Formats of other tools: what goes out to them and comes in from them.

A module here turns values of `mission`, `planner` and `executive` into another program's form, or the other
way round. It knows no database, no job and no web framework; `ground` calls it from its commands and routes.
"""
