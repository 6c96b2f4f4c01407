"""The command line's first step: Ctrl-C during the imports, too, ends with a word and 130; also `python -m p2os`."""

import gc
import os
import signal
import sys


def main() -> None:
    """Run the command line and end the process with its exit code."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)
    gc.disable()  # until a verb is loaded: what imports make stays, and looking through it takes a tenth of the start
    from p2os.cli.main import main as run

    run()


def _end(_number: int, _frame: object) -> None:
    """End before there is anything to put in order."""
    sys.stderr.write("p2os: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    main()
