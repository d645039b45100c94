"""A mission's things as features of OGC API Features."""
