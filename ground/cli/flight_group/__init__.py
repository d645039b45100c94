"""Commands for flight projects: a dictionary in, sequences and plans for other programs out."""
