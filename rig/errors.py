"""The errors that a program may catch, under their public name: ``rig.errors.BadInput`` and the others."""

from rig.core.errors import BadInput, BadLog, RigError

__all__ = ["BadInput", "BadLog", "RigError"]
