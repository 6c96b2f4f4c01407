"""Which lines and branches of the packages run: `pytest --count-lines FOLDER`, for tools/check_coverage.py.

Each process of a run writes a file of its own. slipcover puts probes into the bytecode of what is imported, which
cost a tenth of what tracing does (coverage.py before Python 3.12). Its own command is not used: it takes seen probes
out again, in a pause of a tenth of a second amid a test, which an exception from a signal leaves half done.
"""

import json
import os
import sys
from pathlib import Path

from _pytest.assertion.rewrite import AssertionRewritingHook
from slipcover import FileMatcher, ImportManager, Slipcover

PACKAGES = ("simbase", "p2os", "bluepill_sim", "adapter_sim", "robot_bench", "hardware")
#: Beside `# pragma: no cover` and `if TYPE_CHECKING:`, which slipcover leaves out by itself.
UNCOUNTED = (r"@overload", r"raise NotImplementedError", r"\.\.\.$")
#: No probe is called so often: none is taken out.
NEVER = 2**31 - 1


def is_ours(module: str) -> bool:
    """Tell whether a module is one of the packages."""
    return module.partition(".")[0] in PACKAGES


class LineCounter:
    """A plugin of pytest, in place before any of the packages is imported."""

    def __init__(self, folder: Path) -> None:
        # Where the project is installed its own plugin of pytest comes first. What that has imported is imported anew,
        # and not by pytest, which takes all modules of a plugin's distribution for ones with assertions to rewrite.
        for name in filter(is_ours, list(sys.modules)):
            del sys.modules[name]
        for finder in sys.meta_path:
            if isinstance(finder, AssertionRewritingHook):
                finder._must_rewrite.difference_update([*filter(is_ours, finder._must_rewrite)])
                finder._marked_for_rewrite_cache.clear()
        self._folder = folder
        self._cover = Slipcover(branch=True, d_miss_threshold=NEVER, exclude_also=list(UNCOUNTED))
        self._imports = ImportManager(self._cover, FileMatcher(sources=PACKAGES))
        self._imports.__enter__()

    def pytest_unconfigure(self) -> None:
        """Write what was seen."""
        self._imports.__exit__()
        self._folder.mkdir(exist_ok=True)
        text = json.dumps(self._cover.get_coverage())
        (self._folder / f"{os.getpid()}.json").write_text(text, encoding="utf-8")
