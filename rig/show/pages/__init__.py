"""Reports: HTML files that open without a network.

flight_page.py  the report of a flight, which ``rig.report`` writes; page.py: what all pages have, for other rooms too
course.py  which state each lane took when, and what is shown of a decision
flight_figures.py, servo_figures.py, lane_figures.py, requirement_figures.py, timeline.py  its pictures
lines.py   the lines that they show
"""
