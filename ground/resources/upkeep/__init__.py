"""What keeps a service well over weeks: findings with their remedy, and what may go."""
