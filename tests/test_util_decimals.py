import pytest

from rig.core.decimals import slack, slack_of_product


@pytest.mark.parametrize(
    ("number", "scale", "expected"),
    [
        (0.0166667, 60, 3e-6),  # half of 1e-7, times 60
        (1.66667e-2, 60, 3e-6),
        (-0.0166667, 60, 3e-6),
        (0.0167, 60, 3e-3),
        (0.017, 60, 0.0),  # a thousandth is a sixteenth of the product
        (60.0, 0.0166667, 0.0),
        ("0.0166700", 60, 3e-6),  # as written
        (144.0, 0.00694444, 0.0),  # a whole number is not rounded
        (33.3333, 3.0, 1.5e-4),
        (0.001, 1.0, 0.0),  # small, but of one digit
        (1 / 3, 3.0, 1.5e-16),  # all digits that there are
        (0.0, 60, 0.0),
        (1e300, 1.0, 0.0),
        (float("inf"), 60, 0.0),
        (float("nan"), 60, 0.0),
    ],
)
def test_slack_is_half_a_unit_of_the_last_digit_where_that_is_little(
    number: float | str, scale: float, expected: float
):
    assert slack(number, scale) == pytest.approx(expected, rel=1e-9)


def test_both_factors_of_a_product_may_be_rounded():
    assert slack_of_product(33.3333, 3.00001) == pytest.approx(0.5e-4 * 3.00001 + 0.5e-5 * 33.3333)
