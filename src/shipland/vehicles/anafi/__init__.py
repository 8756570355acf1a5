"""Parrot ANAFI, flown by Parrot's own Olympe in a process and an environment of its own."""
