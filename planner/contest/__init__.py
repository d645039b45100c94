"""A contest for contingency planners: instances, a checker that shares nothing with a planner, a board."""
