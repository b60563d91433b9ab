"""The viewer of flights: the live stream to Rerun and the layout of its viewer.

Only this package imports rerun, and only when a stream is opened: a flight without a stream has no cost.
"""
