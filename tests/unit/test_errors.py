"""One exception family."""

import inspect

import pytest

from shipland import errors

FAMILY = [item for _, item in inspect.getmembers(errors, inspect.isclass)]


@pytest.mark.parametrize("error", FAMILY)
def test_every_error_can_be_caught_as_one(error):
    with pytest.raises(errors.ShiplandError, match=r"^what was wrong$"):
        raise error("what was wrong")


@pytest.mark.parametrize("error", FAMILY)
def test_none_is_mistaken_for_a_builtin_one(error):
    # An `except ValueError` or `except OSError` somewhere must not swallow them.
    assert set(error.__mro__[1:]) <= {errors.ShiplandError, Exception, BaseException, object}
    assert error.__doc__
