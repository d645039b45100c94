"""Where to branch and on what condition; the optimal policy and its bounds."""
