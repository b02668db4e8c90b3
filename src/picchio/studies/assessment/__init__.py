"""The main job: the life of every joint on a task."""
