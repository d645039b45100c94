"""Commands for robot tools: live topics out, recordings in."""
