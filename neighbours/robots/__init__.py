"""Robot people's forms: behaviour trees out, recordings in and out, live topics."""
