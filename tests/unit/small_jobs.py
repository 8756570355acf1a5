"""What workers do in tests; a module of its own, as a worker imports all that stands beside its work."""

import os


def square(number: int) -> int:
    return number * number


def die(number: int) -> None:
    os._exit(3)


def die_at_two(number: int) -> int:
    if number == 2:
        os._exit(3)
    if number == 4:
        raise ValueError("four")
    return number
