"""The command `matchbench`: the program itself, inside this package."""

import signal
import sys

from ._native import command_line


def main() -> None:
    """Executes the command in the arguments and exits."""
    # Python's handler would wait until the program returns. Commands that stop in an orderly way set their own.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(command_line(["matchbench", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
