"""The workspace map: peaks, directions, frequencies and damage all over the workspace."""
