"""Cases flown on several processes; an interruption does not wait for those that have not begun."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

Case = TypeVar("Case")
Result = TypeVar("Result")


def each(fly: Callable[[Case], Result], cases: Sequence[Case], workers: int) -> Iterator[Result]:
    """Yield ``fly`` of every case, in their order."""
    with ProcessPoolExecutor(workers) as pool:
        try:
            yield from pool.map(fly, cases)
        finally:
            pool.shutdown(cancel_futures=True)
