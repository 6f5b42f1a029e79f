"""Registration for recordings with a laser."""
