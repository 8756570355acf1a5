"""One file a command, under a thin `cli`."""
