"""Formats of other tools: what goes out to them and comes in from them.

A module here turns values of `mission`, `planner` and `executive` into another program's form, or the other
way round. It depends on no database, job or web framework; `ground` calls it from its commands and routes.
"""
