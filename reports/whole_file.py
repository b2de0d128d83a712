"""Files that appear whole or not at all, and never in the place of a file that is read."""

import contextlib
import os
import stat


class NotWritten(Exception):
    """The message names the file and the reason."""


def is_same(path, other):
    """Whether both are one file, by device and inode: a link or another way to its folder makes no difference."""
    try:
        return os.path.samefile(path, other)
    except OSError:
        return False


def require_other(path, inputs):
    """NotWritten where a file that is to be written is one of those that are read."""
    for source in inputs:
        if source and is_same(path, source):
            raise NotWritten("{}: is not written, for it is the file that is read as {}".format(path, source))


def require_different(paths):
    """NotWritten where two of the files to write are one."""
    known = {}
    for path in paths:
        place = os.path.realpath(path)
        if place in known and (os.path.isfile(place) or not os.path.exists(place)):
            raise NotWritten("{}: another option writes this file, too".format(path))
        known[place] = path


def is_special(path):
    """Whether it is there and no regular file, as /dev/stdout."""
    return os.path.exists(path) and not stat.S_ISREG(os.stat(path).st_mode)


@contextlib.contextmanager
def whole_file(path, inputs=(), mode="w"):
    """An open file, written beside its target and put into its place where the block ends without an exception. A link
    stays one. Raises NotWritten; an older file then stays as it is."""
    require_other(path, inputs)
    target = os.path.realpath(path)
    pending = target if is_special(target) else "{}.part-{}".format(target, os.getpid())
    encoding = None if "b" in mode else "utf-8"
    try:
        if os.path.isdir(target) or os.path.exists(target) and not os.access(target, os.W_OK):
            open(target, "ab").close()  # which says why not
        with open(pending, mode, encoding=encoding) as stream:
            if os.path.exists(target):
                os.chmod(pending, stat.S_IMODE(os.stat(target).st_mode))
            yield stream
        if pending != target:
            os.replace(pending, target)
    except OSError as error:
        raise NotWritten("{}: could not be written: {}".format(path, error.strerror or error)) from error
    finally:
        if pending != target and os.path.lexists(pending):
            os.remove(pending)


def write_whole(path, content, inputs=()):
    """A whole file of text."""
    with whole_file(path, inputs) as stream:
        stream.write(content)
