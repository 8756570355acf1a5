"""The ship: sea, responses, motion, course, motion base."""
