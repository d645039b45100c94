"""Features that a trained network tells apart; README.md beside this says how it was made."""
