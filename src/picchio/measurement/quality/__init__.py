"""How good measured data are: what is in a campaign, and what is wrong with it."""
