"""Experiments on recorded drives: compared, measured, fitted. Needs the extra `experiments` (NumPy, SciPy).

`drive_files` reads what was driven; `alignment`, `trajectory_errors`, `parting` and `comparison` compare two of
them (`robot_bench.drives` measures one); `fitting` estimates a robot's parameters by least squares; `sensitivity`
varies those of a scenario.
"""

from simbase.errors import MissingDependencyError

#: The extra of pyproject.toml that these packages are in.
EXTRA = "experiments"


def require(*names: str) -> None:
    """Refuse in one line where a package is missing.

    Args:
        names: What is needed beside NumPy and SciPy.

    Raises:
        MissingDependencyError: One is not installed.
    """
    from importlib.util import find_spec

    for name in ("numpy", "scipy", *names):
        if find_spec(name) is None:
            raise MissingDependencyError(f"this verb needs {name}", extra=EXTRA)
