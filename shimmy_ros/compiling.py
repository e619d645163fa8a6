"""How loops are compiled, and kept on disk: numba's cache notices changes of a function's own file
only, so that compiled functions that call each other belong into one file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """``function`` compiled at its first call, from a cache on disk after that."""
    compiler: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
    return cast(Function, compiler(function))
