"""The unit under test: flight software that is not ours, flown frame by frame.

layout.py    the records that go over, from the frame's table of fields, and one walk over them
header.py    the same for C, for Ada and as tables
settings.py  a unit file
port.py      a row of the frame to the input record, an answer to the row
links.py     messages: a library in this process, a socket to a child or a box; the processes that the rig starts
session.py   how a session begins; what arrived and what did not
unit.py      all of them, for one flight; compiled_exchange.py what a frame nearly always is
host.py      the child in which a library runs; exchange_llvm.py its frames, compiled
fmu.py       an FMU: variables, description, link; fmu_host.py the child in which it is stepped
check.py     the conformance test; vectors.py what a monitor must answer
"""
