"""Approvals, waivers and flight rules."""
