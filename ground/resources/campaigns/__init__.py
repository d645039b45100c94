"""Campaigns: a plan of a mission flown many times, with what the runs say while they go on."""
