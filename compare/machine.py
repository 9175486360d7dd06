"""The name of the processor, which is printed with every measured time."""

import platform
import re
from pathlib import Path


def processor():
    """Name, family, model and widest instruction set of the processor, if the system (Linux) tells them."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return platform.processor() or platform.machine()

    def field(name):
        found = re.search(rf"^{name}\s*: (.*)$", text, re.MULTILINE)
        return found[1].strip() if found else "unknown"

    widest = next((name for name in ("amx_int8", "avx512f", "avx2") if f" {name} " in text), "portable")
    return f"{field('model name')}, family {field('cpu family')} model {field('model')}, {widest}"
