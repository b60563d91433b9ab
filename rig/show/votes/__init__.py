"""Votes on recordings as pictures: signals of any name, two to four channels, from a vote or from its output file."""
