"""Effects: what can be wrong with a simulation, one file each."""
