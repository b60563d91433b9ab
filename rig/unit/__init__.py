"""The unit under test: flight software that is not ours, flown frame by frame.

unit_records.py  the records that go over, from the frame's table of fields, and one walk over them
header.py    the same for C, for Ada and as tables
unit_file.py  a unit file
port.py      a row of the frame to the input record, an answer to the row
transport.py  messages: a library in this process, a socket to a child or a box
processes.py the processes that the rig starts; guard.py what stands between and ends all that they start
startup.py   how a session begins; ready_message.py what is wrong with a READY
session.py   what a flight is flown with; what arrived and what did not
running_unit.py  all of them, for one flight; compiled_exchange.py what a frame nearly always is
host.py      the child in which a library runs; exchange_llvm.py its frames, compiled
fmu.py       an FMU: its link; fmu_description.py the records as its variables; fmu_mapping.py variables of other names
fmu_host.py  the child in which it is stepped
vectors.py   what a monitor must answer (bench/unit_check.py asks it)
"""
