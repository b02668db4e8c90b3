"""Effects on the masses that move, and on where the force meets them."""
