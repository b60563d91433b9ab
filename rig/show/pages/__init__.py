"""Reports: HTML files that open without a network; of one flight here, ``page`` for those of other rooms.

``rig.report`` is the function that writes that of a flight (flight.write_report).
"""
