"""What the narrow pair of the mast tells of a target: where it was designated, later which spot was meant."""
