"""What is flown: a scenario's configuration, what fails in it, its seeds, and one flight of it."""
