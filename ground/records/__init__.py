"""What all kinds of resource have in common: rights, reading, listing, changing, deleting, history."""
