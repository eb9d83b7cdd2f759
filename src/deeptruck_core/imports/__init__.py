"""When libraries and entry points are imported."""
