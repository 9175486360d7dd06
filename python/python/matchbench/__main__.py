"""The command `matchbench`: the program itself, inside this package."""

import sys

from ._native import command_line


def main() -> None:
    """Executes the command in the arguments and exits."""
    sys.exit(command_line(["matchbench", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
