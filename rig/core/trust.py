"""Permission to run code: a manager class that a file names is imported only with permission.

A log, a scenario, a campaign or a vote configuration may name code (``module:name``) as its manager.  The
option ``--allow-code`` (``allow_code=True`` in Python) permits the code of a file; a class named on the command
line itself, ``--set redundancy.manager=module:name``, needs no other permission.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from rig.core.confined import may_run_code
from rig.core.errors import BadInput


@dataclass(frozen=True, slots=True)
class Trust:
    """Permission to import code for settings, and the file of the settings.

    It accompanies the settings and is no part of them: any two compare equal.
    """

    source: str = field(default="the scenario", compare=False)  # the file that a refusal names
    allow_code: bool = field(default=False, compare=False)  # any class
    named: str | None = field(default=None, compare=False)  # the class named on the command line

    def require(self, manager: str) -> None:
        """Refuse a class without permission; BadInput names it, its file and the option.

        manager : a setting ``redundancy.manager``; the built-in ones need no permission
        """
        if ":" in manager and not may_run_code():
            raise BadInput(f"{self.source}: redundancy.manager: {manager!r} is code, and rig mcp runs no code")
        if ":" in manager and not self.allow_code and manager != self.named:
            raise BadInput(
                f"{self.source}: redundancy.manager: {manager!r} is code, which runs only with --allow-code "
                "(in Python: allow_code=True)"
            )

    def allowing(self, allow_code: bool) -> Trust:
        """Return the same trust, or one that permits any class if ``allow_code``."""
        return replace(self, allow_code=self.allow_code or allow_code)
