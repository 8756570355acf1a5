"""Near vision: the cue's corners and the camera's pose."""
