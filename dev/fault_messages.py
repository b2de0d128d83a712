"""Messages of any type that no sensor should send, and what must hold for a message of any type that a node publishes.

Types are known by their definitions alone (genpy): there is no list of fields here."""
import copy
import functools
import io
import math
import re
import struct
import sys

import genpy
import numpy

DOUBLES = (math.nan, math.inf, -math.inf, sys.float_info.max, 5e-324, -1.0, 0.0, 1e300)
FLOATS = (math.nan, math.inf, -math.inf, 3.4028234663852886e38, 1e-45, -1.0, 0.0, 1e30)
STRINGS = {"empty": "", "1 MB": "x" * (1 << 20), "controls": "\x00\x01\x1b[31m\n\r\t\x7f\u202e%s%n", "slash": "/"}
SHIFTS_S = (3600.0, -3600.0, 4.0, -4.0)
TIMES = ((0, 0), (2 ** 32 - 1, 0), (2 ** 32 - 1, 2 ** 32 - 1), (1, 2 ** 32 - 1))
MANY = 20000   # elements of an array that is huge
MANY_BYTES = 4 << 20
BITS = {"int8": 8, "uint8": 8, "byte": 8, "char": 8, "int16": 16, "uint16": 16, "int32": 32, "uint32": 32,
        "int64": 64, "uint64": 64}
ARRAY = re.compile(r"(.*)\[(\d*)\]$")


# --- odd messages: pairs of a name and a function that changes a good message, or gives another one

class Shift:
    """A stamp that many seconds later than the good one, no earlier than 0."""

    def __init__(self, seconds):
        self.seconds = seconds

    def of(self, stamp):
        return genpy.Time.from_sec(max(0.0, stamp.to_sec() + self.seconds))


def odd_values(kind):
    """{name: value} that may stand in a field of that type."""
    if kind in ("float64", "float32"):
        return {"%g" % each: each for each in (DOUBLES if kind == "float64" else FLOATS)}
    if kind in BITS:
        signed = kind.startswith("int") or kind == "byte"
        least, most = (-(1 << BITS[kind] - 1), (1 << BITS[kind] - 1) - 1) if signed else (0, (1 << BITS[kind]) - 1)
        return {str(each): each for each in sorted({0, least, most, max(least, -1)})}
    if kind == "bool":
        return {"255": 255, "0": 0}
    if kind == "string":
        return STRINGS
    if kind in ("time", "duration"):
        times = {"%d.%09d" % each: _time(kind, *each) for each in TIMES}
        if kind == "time":
            times.update({"%+g s" % each: Shift(each) for each in SHIFTS_S})
        return times
    return {}


def _time(kind, secs, nsecs):
    """Not normalised, unlike what the constructor makes."""
    time = genpy.Time() if kind == "time" else genpy.Duration()
    most = 2 ** 32 if kind == "time" else 2 ** 31
    time.secs, time.nsecs = min(secs, most - 1), min(nsecs, most - 1)
    return time


def odd_arrays(kind, value):
    """{name: value} of an array without a fixed size, of elements of that type."""
    if kind in ("uint8", "char"):
        return {"empty": b"", "half": value[:len(value) // 2], "one": value[:1] or b"x", "huge": bytes(MANY_BYTES)}
    element = value[0] if len(value) else (0 if kind in BITS or kind.startswith("float") else None)
    if element is None:
        return {"empty": []}
    return {"empty": [], "one": [element], "double": list(value) + list(value), "huge": [element] * MANY}


def field_cases(message, path=()):
    """Of every field of a good message: (name, path, odd value)."""
    for name, kind in zip(message.__slots__, message._slot_types):
        yield from value_cases(kind, getattr(message, name), path + (name,))


def value_cases(kind, value, path):
    """Of one field, and of what is within it."""
    array = ARRAY.match(kind)
    if array:
        element, fixed = array.groups()
        if not fixed:
            yield from ((name_of(path, name), path, odd) for name, odd in odd_arrays(element, value).items())
        if element in ("uint8", "char"):
            return
        for index in range(len(value) if fixed else min(1, len(value))):
            yield from value_cases(element, value[index], path + (index,))
    elif isinstance(value, genpy.Message):
        yield from field_cases(value, path)
    else:
        yield from ((name_of(path, name), path, odd) for name, odd in odd_values(kind).items())


def name_of(path, value):
    """pose.covariance.7=nan"""
    return ".".join(map(str, path)) + "=" + value


def with_value(message, path, value):
    """A copy of the message with the value at the path."""
    message = copy.deepcopy(message)
    _set(message, path, value)
    return message


def _set(container, path, value):
    if len(path) > 1:
        inner = _get(container, path[0])
        if isinstance(inner, tuple):
            inner = list(inner)
        _put(container, path[0], inner)
        _set(inner, path[1:], value)
    else:
        _put(container, path[0], value.of(_get(container, path[0])) if isinstance(value, Shift) else value)


def _get(container, key):
    return container[key] if isinstance(key, int) else getattr(container, key)


def _put(container, key, value):
    if isinstance(key, int):
        container[key] = value
    else:
        setattr(container, key, value)


def buffer_of(message):
    """As it goes over the wire."""
    stream = io.BytesIO()
    message.serialize(stream)
    return stream.getvalue()


@functools.lru_cache(maxsize=None)
def _raw_type(kind):
    def serialize(self, stream):
        stream.write(self.raw)
    return type("Raw" + kind.__name__, (kind,), {"serialize": serialize, "__slots__": kind.__slots__ + ["raw"],
                                                 "_slot_types": kind._slot_types})


def raw_message(message, data):
    """A message whose bytes are `data`, whatever they mean."""
    raw = _raw_type(type(message))()
    raw.raw = data
    return raw


def damaged(message, numbers):
    """Its bytes, cut off, longer, or with bits turned over."""
    data = bytearray(buffer_of(message))
    kind = numbers.choice(("cut", "longer", "bits", "word"))
    if kind == "cut":
        return raw_message(message, bytes(data[:numbers.randrange(len(data))]))
    if kind == "longer":
        return raw_message(message, bytes(data) + bytes(numbers.randrange(256) for _ in range(1000)))
    if kind == "bits":
        for _ in range(8):
            data[numbers.randrange(len(data))] ^= 1 << numbers.randrange(8)
        return raw_message(message, bytes(data))
    begin = numbers.randrange(max(1, len(data) - 4))
    data[begin:begin + 4] = struct.pack("<I", numbers.choice((0xffffffff, 0x7fffffff, 0x10000000, 0)))
    return raw_message(message, bytes(data))


# --- what must hold for a message

@functools.lru_cache(maxsize=None)
def _comments(kind):
    """{field: what its definition says}; with the words at the head of the file, which are about all fields."""
    own = kind._full_text.split("=" * 40)[0]
    found, before, head, last = {}, "", None, ""
    for line in own.splitlines():
        code, _, comment = line.partition("#")
        words = code.split()
        if len(words) < 2:
            if not line.strip() and head is None:
                head, before = before, ""
            before = before + " " + comment if line.strip() else ""
            continue
        head = before if head is None else head
        if "=" not in code:
            last = last if "likewise" in comment else head + before + comment
            found[words[1]] = last
        before = ""
    return found


@functools.lru_cache(maxsize=None)
def _plan(kind):
    """(field, its type, whether numbers of it may be none, infinite) of all fields with numbers in them."""
    comments = _comments(kind)
    plan = []
    for name, field in zip(kind.__slots__, kind._slot_types):
        base = ARRAY.match(field).group(1) if ARRAY.match(field) else field
        if base in BITS or base in ("bool", "string", "time", "duration"):
            continue
        words = comments.get(name, "")
        plan.append((name, base, field != base, "NaN" in words, "infinite" in words))
    return plan


def fault_of(message):
    """(what is wrong with the numbers of the message, where), or None."""
    kind = type(message)
    if kind._type == "sensor_msgs/PointCloud2":
        return _cloud_fault(message)
    for name, base, is_array, may_be_nan, may_be_infinite in _plan(kind):
        value = getattr(message, name)
        values = value if is_array else (value,)
        if base.startswith("float"):
            fault = _numbers_fault(name, values, may_be_nan, may_be_infinite)
            if fault:
                return fault, kind._type + " " + name
        else:
            for each in values:
                fault = fault_of(each)
                if fault:
                    return fault
    return None


def _numbers_fault(name, values, may_be_nan, may_be_infinite):
    for value in values:
        if not (math.isfinite(value) or may_be_nan and math.isnan(value) or may_be_infinite and math.isinf(value)):
            return "non-finite"
    size = math.isqrt(len(values))
    if "covariance" in name and size > 1 and size * size == len(values):
        if any(values[i * (size + 1)] < 0.0 for i in range(size)):
            return "negative variance"
    return None


def _cloud_fault(cloud):
    if len(cloud.data) % 4 or any(field.datatype != field.FLOAT32 for field in cloud.fields):
        return "non-finite", "sensor_msgs/PointCloud2 fields"
    is_finite = numpy.isfinite(numpy.frombuffer(bytes(cloud.data), dtype="<f4")).all()
    return None if is_finite else ("non-finite", "sensor_msgs/PointCloud2 data")
