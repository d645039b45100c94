"""A rover in MuJoCo, the physics engine of others: an opinion on drives that shares no chassis with ours."""
