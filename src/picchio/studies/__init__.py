"""Questions asked of a model: what a riveting task does to its joints."""
