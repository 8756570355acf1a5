"""What can be flown: one protocol, its implementations."""
