"""Results kept for settings: one for the same objects, another for what is equal and not the same."""

import numpy as np
import pytest

from rig.core import kernel_cache
from rig.core.kept import kept


class Settings:
    """An object with an identity."""


def test_a_result_is_worked_out_once_for_the_same_objects_and_again_for_others():
    calls: list[tuple[object, float]] = []

    @kept
    def of(settings: Settings, rate: float) -> tuple[int]:
        calls.append((settings, rate))
        return (len(calls),)

    one, other = Settings(), Settings()
    assert of(one, 100.0) is of(one, 100.0) and len(calls) == 1
    assert of(other, 100.0) == (2,) and of(one, 50.0) == (3,) and of(one, 100.0) == (1,)


def test_numbers_of_another_type_are_others():
    @kept
    def of(number: float) -> str:
        return repr(number)

    assert [of(1), of(1.0), of(True), of(1)] == ["1", "1.0", "True", "1"]


def test_an_object_that_is_gone_never_lends_its_identity_to_another():
    @kept
    def of(settings: Settings) -> int:
        return id(settings)

    for _ in range(200):
        fresh = Settings()
        assert of(fresh) == id(fresh)


def test_many_objects_are_not_all_kept():
    held: list[Settings] = []

    @kept
    def of(settings: Settings) -> Settings:
        held.append(settings)
        return settings

    many = [Settings() for _ in range(100)]
    for each in many:
        assert of(each) is each
    for each in (many[-1], many[0]):
        of(each)
    assert held[-1] is many[0] and len(held) == 101


def test_an_array_that_is_shared_cannot_be_written():
    @kept
    def of(count: int) -> np.ndarray:
        return np.zeros(count)

    with pytest.raises(ValueError, match="read-only"):
        of(3)[0] = 1.0


def test_what_is_kept_has_no_part_in_the_key_of_a_kernel_that_reaches_the_function():
    @kept
    def doubled(value: object) -> list[object]:
        return [value, value]

    def names() -> object:
        return doubled

    keys = [kernel_cache.reach.__wrapped__(names)]
    doubled(object())
    kernel_cache._own_parts.cache_clear()
    keys.append(kernel_cache.reach.__wrapped__(names))
    assert keys[0] == keys[1]
