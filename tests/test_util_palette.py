"""Lines of a figure are told apart by colour, and by dashes where there are more lines than colours."""

from rig.core.palette import SERIES, series_colour, series_dash


def test_no_two_lines_look_alike_until_colours_and_dashes_are_used_up():
    looks = [(series_colour(i), series_dash(i)) for i in range(4 * len(SERIES) + 1)]
    assert len(set(looks[:-1])) == 4 * len(SERIES) and looks[-1] == looks[0]
    assert {dash for _, dash in looks[: len(SERIES)]} == {"solid"}
