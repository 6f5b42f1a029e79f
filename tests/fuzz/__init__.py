"""Coverage-guided fuzzing of whatever bytes of others are read; not part of pytest."""
