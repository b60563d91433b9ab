"""The catalogue of fault kinds: what ``rig faults`` says, taken from the settings themselves."""
