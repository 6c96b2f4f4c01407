"""Which lines and branches of the packages run: `pytest --count-lines FOLDER`, for tools/check_coverage.py.

Each process of a run writes a file of its own. slipcover puts probes into the bytecode of what is imported, which
cost a tenth of what tracing does (coverage.py before Python 3.12), as long as those that were seen are taken out again.
Its own command does so amid a test, in a pause which an exception from a signal leaves half done; here it is done
between two tests.
"""

import json
import os
import sys
import time
from pathlib import Path

from _pytest.assertion.rewrite import AssertionRewritingHook
from slipcover import FileMatcher, ImportManager, Slipcover

PACKAGES = ("simbase", "p2os", "bluepill_sim", "adapter_sim", "robot_bench", "hardware")
#: Beside `# pragma: no cover` and `if TYPE_CHECKING:`, which slipcover leaves out by itself.
UNCOUNTED = (r"@overload", r"raise NotImplementedError", r"\.\.\.$")
#: No probe is called so often that slipcover takes it out by itself.
NEVER = 2**31 - 1
#: chosen: seconds of processor time between two times, and at least so many times what one has taken.
PAUSE_S, PAUSES = 1.0, 10


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
        self._due_s = time.process_time() + PAUSE_S

    def pytest_runtest_logfinish(self) -> None:
        """Take out the probes of what was seen, now and then."""
        began_s = time.process_time()
        if began_s >= self._due_s:
            self._cover.deinstrument_seen()
            now_s = time.process_time()
            self._due_s = now_s + max(PAUSE_S, PAUSES * (now_s - began_s))

    def pytest_unconfigure(self) -> None:
        """Write what was seen."""
        self._imports.__exit__()
        self._folder.mkdir(exist_ok=True)
        text = json.dumps(self._cover.get_coverage())
        (self._folder / f"{os.getpid()}.json").write_text(text, encoding="utf-8")
