"""What the simulation gets wrong, why, and what that does to the life."""
