"""Quality checks of a campaign: what it contains, and what is wrong with it."""
