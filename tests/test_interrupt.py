import signal
import threading
from collections.abc import Iterator

import pytest

from rig.interrupt import interruptible


@pytest.fixture(autouse=True)
def pythons_own() -> Iterator[None]:
    """A process that was started in the background ignores Ctrl-C from the first."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_the_first_ctrl_c_asks_for_an_end_and_the_second_is_pythons_own():
    with interruptible() as stop:
        assert not stop.requested
        signal.raise_signal(signal.SIGINT)
        assert stop.requested
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_ctrl_c_is_as_before_when_nothing_is_under_way_any_more():
    before = signal.getsignal(signal.SIGINT)
    with interruptible():
        assert signal.getsignal(signal.SIGINT) is not before
    assert signal.getsignal(signal.SIGINT) is before


def test_a_thread_flies_without_touching_ctrl_c():
    before, seen = signal.getsignal(signal.SIGINT), []

    def flies() -> None:
        with interruptible() as stop:
            seen.append((stop.requested, signal.getsignal(signal.SIGINT)))

    thread = threading.Thread(target=flies)
    thread.start()
    thread.join()
    assert seen == [(False, before)]
