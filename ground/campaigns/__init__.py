"""Campaigns: one plan flown many times, and what that says of it.

A campaign is plan x world x rover x seeds x variants. It is cut into units of runs by index; a unit is a pure
function of its case and its seeds and sends back one row a run. So the answer does not depend on engine,
workers, order, or a worker's death, and any row can be flown again into a whole `run/1` folder.

Nothing here knows a database, a job or a web framework.
"""
