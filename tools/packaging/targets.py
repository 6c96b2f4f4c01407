"""The platforms that wheels are built for, all by one compiler: zig's, which has every one's C library with it.

A wheel calls nothing of Python's own, so it is for every Python 3 of its platform. Where programs were run is said by
docs/houses.md.
"""

import importlib.util
import sys
from collections.abc import Mapping
from dataclasses import dataclass

from simbase.errors import MissingDependencyError


@dataclass(frozen=True, slots=True)
class WheelTarget:
    """A platform."""

    tag: str  # of the wheel
    triple: str  # as zig names it, with the oldest C library
    is_unix: bool = True


#: glibc 2.17 is that of every Linux since 2014, musl 1.2 of Alpine since 3.13.
TARGETS: Mapping[str, WheelTarget] = {
    target.tag: target
    for target in (
        WheelTarget("manylinux_2_17_x86_64", "x86_64-linux-gnu.2.17"),
        WheelTarget("manylinux_2_17_aarch64", "aarch64-linux-gnu.2.17"),
        WheelTarget("musllinux_1_2_x86_64", "x86_64-linux-musl"),
        WheelTarget("musllinux_1_2_aarch64", "aarch64-linux-musl"),
        WheelTarget("macosx_11_0_x86_64", "x86_64-macos.11.0"),
        WheelTarget("macosx_11_0_arm64", "aarch64-macos.11.0"),
        WheelTarget("win_amd64", "x86_64-windows-gnu", is_unix=False),
    )
}


def environment(target: WheelTarget) -> dict[str, str]:
    """Return what a build's environment has more, for a target.

    Nothing of the Python that builds goes in: its linker line has the folder that it lies in.

    Raises:
        MissingDependencyError: zig is not installed.
    """
    if importlib.util.find_spec("ziglang") is None:
        raise MissingDependencyError("wheels of other platforms need zig, a compiler", hint="pip install ziglang")
    c, cxx = (f"{sys.executable} -m ziglang {name} -target {target.triple}" for name in ("cc", "c++"))
    return {
        "CC": c, "CXX": cxx, "LDSHARED": f"{c} -shared -s", "LDCXXSHARED": f"{cxx} -shared -s", "CFLAGS": "-g0",
        "P2OS_WHEEL_PLATFORM": target.tag,
    }  # fmt: skip
