"""The aircraft as an FMU: plant, sensors, servos and faults, without the flight computer, for another simulation tool.

computer_outside.py       scenarios that fly without a flight computer inside, and why others do not
stepped.py                the aircraft, stepped from outside a frame at a time
aircraft_variables.py     the variables of the FMU; aircraft_description.py: its modelDescription.xml
aircraft_slave.py         the FMU itself, as pythonfmu and pythonfmu3 call it
aircraft_archive.py       the file: ``rig fmu build``
"""
