"""The tree of frames: the frames' roles, and poses between frames at a time."""
