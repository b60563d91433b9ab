"""The redundancy page on the terminal: while a flight is flown, or played from its log."""
