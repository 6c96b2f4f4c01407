"""Trust: which code that a file names may be executed, who has said so, and what of it that was said of.

A scenario, a fleet or a campaign may name a class in a Python file (`./mine.py:Class`), and such files travel. A name
out of a file becomes a `Code`, and only one that somebody has admitted is executed; a plain text never is
(`simbase.user_classes`). What an installed package brings by entry points is part of the tool (`simbase.entry_points`).

What a command line or a program names itself needs nobody's word: `own_code`.
"""

from simbase.trust.code import Code, own_code
from simbase.trust.decision import Trust, UntrustedError
from simbase.trust.fingerprint import Fingerprint, fingerprint_of

__all__ = ["Code", "Fingerprint", "Trust", "UntrustedError", "fingerprint_of", "own_code"]
