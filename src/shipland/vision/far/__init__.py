"""Far vision: learned detectors of ship and bar."""
