"""What the two campaigns share: how a program of the package is started, its limits, the table of what came of it."""
import os
import resource
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))
sys.path.append(os.path.join(ROOT, "reports"))

from package_programs import program  # noqa: E402, F401

MOST_MEMORY = 4 << 30  # bytes of address space: more is a refusal to allocate, not a swapping machine


def limit_memory():
    """Of the process that is about to start."""
    if "TSAN_OPTIONS" not in os.environ:  # dev/sanitize.sh: a sanitizer maps terabytes
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def table_of(head, rows):
    """As lines of text: a row has a name, then numbers."""
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    return "\n".join(lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows])
