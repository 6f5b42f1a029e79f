"""The tree of frames: which frame plays which part, and poses between them at a time."""
