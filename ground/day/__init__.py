"""A mission's day as it goes from the repository to planner and rover."""
