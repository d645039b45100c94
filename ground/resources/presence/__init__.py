"""Who else looks at a mission, and what they have selected."""
