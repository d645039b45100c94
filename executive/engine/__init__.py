"""The engine: events of one time stamp in, effects out; pure and single-owner."""
