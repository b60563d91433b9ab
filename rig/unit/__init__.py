"""The unit under test: flight software that is not ours, flown frame by frame.

layout.py    the records that go over, from the frame's table of fields
header.py    the same for C; ada.py for Ada; description.py as tables
settings.py  a unit file
port.py      a row of the frame to the input record, an answer to the row
reply_check.py  what arrived and what did not
links.py     messages: a library in this process, a socket to a child or a box
processes.py what the rig starts, and its end
host.py      the child in which a library runs
fmu.py       an FMU; fmu_host.py the child in which it is stepped; fmu_description.py its modelDescription.xml
unit.py      all of them, for one flight
"""
