"""The computers of a flight: one, or several lanes that do the same.

computers_table.py  the ``[computers]`` table
think.py     one frame of one computer, from its BUS record to its FCC record
lanes_stage.py  several of them: state and records of each lane, and who leads
lane_clock.py  when each lane samples, and how their clocks are kept together
link.py      what each lane's BUS has of the others' channels
exchange.py  what each lane holds of another's word, after one round or two
alike.py     the lanes that have had the same samples: one thinks for all
command.py   the vote of their commands
health.py    which lanes vote out which
backup_lane.py  the law that flies without a lane; what it and a lane that starts again begin with
"""
