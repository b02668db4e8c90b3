"""Effects on what holds the masses: springs and dampers, of joints and of what else yields."""
