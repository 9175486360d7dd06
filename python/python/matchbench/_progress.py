"""Shows the progress of a run: a line on a terminal, a line below the cell of a notebook, nothing elsewhere."""

import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any

_Bar = Callable[[int, int, str, str], None]


@contextmanager
def shown(progress: bool | _Bar) -> Generator[_Bar | None, None, None]:
    """The function that a run calls from time to time. The line ends with the run."""
    if callable(progress):
        yield progress
        return
    handle = _notebook() if progress else None
    start = time.monotonic()

    def line(done: int, total: int, dataset: str, matcher: str) -> str:
        width = round(30 * done / total)
        elapsed = time.monotonic() - start
        return f"{'█' * width}{'░' * (30 - width)} {done}/{total}  {elapsed:.0f} s  {dataset} {matcher}"

    if handle is not None:

        def on_page(done: int, total: int, dataset: str, matcher: str) -> None:
            handle.update({"text/plain": line(done, total, dataset, matcher)}, raw=True)

        yield on_page
    elif progress and sys.stderr.isatty():

        def on_terminal(done: int, total: int, dataset: str, matcher: str) -> None:
            sys.stderr.write("\r" + line(done, total, dataset, matcher).ljust(79))
            sys.stderr.flush()

        try:
            yield on_terminal
        finally:
            sys.stderr.write("\n")
    else:
        yield None


def _notebook() -> Any:
    """A place below the cell, if this is a notebook."""
    if "IPython" not in sys.modules:
        return None
    display: Any = sys.modules.get("IPython.display")
    shell: Any = sys.modules["IPython"].get_ipython()
    if display is None or type(shell).__name__ != "ZMQInteractiveShell":
        return None
    return display.display({"text/plain": ""}, raw=True, display_id=True)
