"""The catalogue of fault kinds: what ``rig faults`` says, taken from the settings themselves."""

from rig.catalogue.entries import EXAMPLES, Entry, Parameter, common, entries, entry

__all__ = ["EXAMPLES", "Entry", "Parameter", "common", "entries", "entry"]
