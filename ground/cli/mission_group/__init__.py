"""Further commands of the group `mission`."""
