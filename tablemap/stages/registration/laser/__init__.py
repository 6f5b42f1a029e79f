"""Registration where the laser sees the stops."""
