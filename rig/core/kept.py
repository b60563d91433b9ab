"""Results kept for settings: flights of a campaign share the settings that no run changes, and what follows from them.

Settings are frozen, so the same object gives the same result; what is equal but another object is worked out again.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, Final, TypeVar

import numpy as np

F = TypeVar("F", bound=Callable[..., Any])
_MOST: Final = 16  # results of a function: aircraft of a campaign
_VALUES: Final = (bool, int, float, str, type(None))


def kept(function: F) -> F:
    """Keep the last results of ``function`` for arguments that are the same objects, or equal numbers or texts.

    The result is shared: an array of it cannot be written to.  The arguments must never change: frozen settings, and
    what such a function has returned.
    """
    results: dict[tuple[Any, ...], tuple[tuple[Any, ...], Any]] = {}

    @wraps(function)
    def call(*given: Any) -> Any:
        key = tuple((type(one), one) if isinstance(one, _VALUES) else id(one) for one in given)
        found = results.get(key)
        if found is None:
            made = function(*given)
            if isinstance(made, np.ndarray):
                made.flags.writeable = False
            if len(results) >= _MOST:
                results.clear()
            found = results[key] = given, made  # while an argument is held, no other object has its identity
        return found[1]

    answer: Any = call
    answer.cache_parameters = lambda: {"maxsize": _MOST}  # as of functools.cache: keys of kernels skip what it keeps
    return answer
