"""Compilation of plain loops over floats and arrays with Numba; its machine code is kept on disk where that can be."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """`function`, compiled at its first call; the same floating-point results as Python's in the same order.

    Division by zero gives infinity or NaN, as NumPy's does, not an exception. The machine code is kept beside the
    source or in the user's cache; where neither can be written, every process compiles anew.
    """
    try:
        return cast(F, numba.njit(cache=True, error_model="numpy")(function))
    except RuntimeError:  # no folder can be written
        return cast(F, numba.njit(error_model="numpy")(function))
