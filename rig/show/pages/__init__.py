"""Reports: HTML files that open without a network.

flight_page.py  the report of a flight, which ``rig.report`` writes
course.py       states and events of a flight over time, and the frames of a decision
decision_figure.py, flight_figures.py, servo_figures.py, lane_figures.py, requirement_figures.py, timeline.py  pictures
lines.py        the lines in the pictures
page.py, themes.py, base.html, parts.html  common to all reports, those of other rooms too
"""
