"""The unit under test: external flight software, flown frame by frame.

unit_records.py  the interface records, from the frame's table of fields, and one walk over them
header.py    the records for C, for Ada and as tables
unit_file.py  a unit file
port.py      from a row of the frame to the input record, from an answer to the row
transport.py  messages: a library in this process, a socket to a child or a box
connect.py   the transport of a unit file, reached; unit_facts.py what a log tells of a unit
processes.py the processes that the rig starts; guard.py their guard, which ends everything that they start
startup.py   start of a session; ready_message.py check of a READY
session.py   configuration of a flight; counts of lost and late messages
running_unit.py  all parts for one flight; compiled_exchange.py the usual frame in compiled code
python_law.py  a control law in Python
host.py      the child in which a library runs; exchange_llvm.py its frames, compiled
fmu.py       an FMU: its link; fmu_description.py the records as its variables; fmu_mapping.py variables of other names
fmu_host.py  the child process that steps the FMU
vectors.py   required answers of a monitor (bench/unit_check.py tests them)
"""
