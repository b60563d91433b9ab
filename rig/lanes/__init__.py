"""The computers of a flight: what one of them thinks in a frame.

think.py   one computer, from its BUS record to its FCC record
"""
