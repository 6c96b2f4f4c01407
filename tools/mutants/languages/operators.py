"""What a mutant puts in place of what: the tables that Python and C share, and those of each."""

import re

#: A comparison, and what replaces it: the boundary moved, and the opposite.
COMPARISONS = {
    "<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"), "==": ("!=",), "!=": ("==",),
}  # fmt: skip
#: The same of Python's words.
WORDS_COMPARED = {"is": ("is not",), "is not": ("is",), "in": ("not in",), "not in": ("in",)}

#: Signs of arithmetic, in an expression and with `=` behind.
SIGNS = {
    "+": "-", "-": "+", "*": "/", "/": "*", "//": "*", "%": "*", "<<": ">>", ">>": "<<", "&": "|", "|": "&", "^": "&",
}  # fmt: skip

#: Functions of which one is taken for the other.
FUNCTIONS = {"min": "max", "max": "min", "any": "all", "all": "any", "floor": "ceil", "ceil": "floor"}

#: Truth values, as each language spells them.
TRUTHS = {"True": "False", "False": "True", "true": "false", "false": "true"}

_NUMBER = re.compile(r"(?P<digits>0[xX][0-9a-fA-F'_]+|0[bB][01'_]+|[0-9]['_0-9]*)(?P<suffix>[uUlLzZ]*)")
_FLOAT = re.compile(r"(?P<digits>[0-9'_]*\.?[0-9'_]+\.?(?:[eE][+-]?[0-9]+)?)(?P<suffix>[fFlL]?)")


def other_constants(text: str) -> tuple[str, ...]:
    """Return what replaces a number: one more and one less; of a float its double and its half.

    Args:
        text: The number as a source spells it, in Python or C, without a sign.
    """
    if whole := _NUMBER.fullmatch(text):
        digits, suffix = whole["digits"].replace("'", "").replace("_", ""), whole["suffix"]
        value = int(digits, 8) if re.fullmatch("0[0-7]+", digits) else int(digits, 0)
        less = (f"{value - 1}{suffix}",) if value else () if "u" in suffix.lower() else (f"(-1{suffix})",)
        return (f"{value + 1}{suffix}", *less)
    if real := _FLOAT.fullmatch(text):
        size, suffix = float(real["digits"].replace("'", "").replace("_", "")), real["suffix"]
        others = (size * 2, size / 2) if size else (1.0,)
        return tuple(f"{other!r}{suffix}" for other in others)
    return ()
