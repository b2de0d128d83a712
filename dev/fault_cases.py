"""The cases of the live campaign: one odd message of each kind, odd streams, clocks, requests, signals."""
import collections
import random
import signal
import threading

import fault_messages

# group: what kind of case; act: what it does to a session; may_reset: it is more than one odd message, after which what
# was known may be given up; is_command: a user may say so, and is believed until he says better.
Case = collections.namedtuple("Case", "rig topic kind name group act may_reset is_command")
RAW = 12         # damaged messages of each topic
AT_START = 30    # odd fields of each topic at the start
JUMPS_S = (3600.0, -3600.0, -10.0, 3.0, 30.0)
LOSSES_S = (1.0, 5.0, 20.0)
CALLERS, CALLS = 10, 20


def full_name(case):
    return "%s %s %s %s" % (case.rig, case.topic, case.kind, case.name)


def all_cases(session, seed):
    """Of a rig whose nodes run."""
    cases = []
    for topic, kind in sorted(session.subscriptions.items()):
        cases += topic_cases(session, topic, kind, seed)
    for name, kind in sorted(session.services.items()):
        cases += service_cases(session, name, kind)
    cases += stream_cases(session)
    cases += start_cases(session, seed)
    if session.stream.simulated_time:
        cases += clock_cases(session)
    return [case for case in cases if session.rig.only is None or case.group in session.rig.only]


def topic_cases(session, topic, kind, seed):
    """One odd message among good ones."""
    def make(name, group, act):
        return Case(session.rig.name, topic, kind._type, name, group, act, False, topic in session.rig.commands)

    group = "clock" if topic == "/clock" else "field"
    for name, path, value in fault_messages.field_cases(session.good(topic)):
        yield make(name, group, lambda s, path=path, value=value: s.publish(
            topic, fault_messages.with_value(s.good(topic), path, value)))
    for k in range(RAW if group == "field" else 0):
        name = "bytes %d" % k
        yield make(name, group, lambda s, name=name: s.publish(topic, fault_messages.damaged(
            s.good(topic), random.Random("%d %s %s" % (seed, topic, name)))))


def stream_cases(session):
    """Odd streams of each topic that has one."""
    def make(topic, name, act, may_reset):
        kind = session.subscriptions[topic]._type if topic in session.subscriptions else "all streams"
        return Case(session.rig.name, topic, kind, name, "stream", act, may_reset, False)

    for topic in sorted(session.fed_topics()):
        yield make(topic, "20 times the same", lambda s, t=topic: s.publish(t, *[s.good(t)] * 20), False)
        yield make(topic, "5 in reverse", lambda s, t=topic: s.publish(
            t, *[s.good(t, 0.001 * k) for k in range(5, 0, -1)]), False)
        for late_s in (0.3, 1.5, 10.0):
            yield make(topic, "%g s late" % late_s, lambda s, t=topic, late_s=late_s: s.publish(
                t, s.good(t, -late_s)), False)
        yield make(topic, "300 at once", lambda s, t=topic: s.publish(
            t, *[s.good(t, 1e-5 * k) for k in range(1, 301)]), False)
        for seconds in LOSSES_S:
            yield make(topic, "none for %g s" % seconds, lambda s, t=topic, seconds=seconds: s.feed_for(
                seconds, lambda topic, message: [] if topic == t else [message]), True)
        for shift_s in (0.3, -0.3, 3600.0, -3600.0):
            yield make(topic, "a second publisher at %+g s" % shift_s, lambda s, t=topic, shift_s=shift_s: s.feed_for(
                2.0, lambda topic, message: [message] + ([s.good(t, shift_s)] if topic == t else [])), True)
    for seconds in JUMPS_S:
        yield make("/", "all stamps jump %+g s" % seconds, lambda s, seconds=seconds: s.jump(seconds), True)
    yield make("/", "silence of 20 s", lambda s: s.feed_for(20.0, lambda topic, message: []), True)


def start_cases(session, seed):
    """An odd message before the first good one, or after a few: nodes that have a service ~reset start anew for it."""
    reset = next((name for name in session.services if name.endswith("/reset")), None)
    if reset is None:
        return
    for topic in sorted(session.fed_topics()):
        kind = session.subscriptions[topic]
        fields = list(fault_messages.field_cases(session.good(topic)))
        fields = random.Random("%d %s" % (seed, topic)).sample(fields, min(AT_START, len(fields)))
        fields += [each for each in fault_messages.field_cases(session.good(topic))
                   if each[0].startswith("header.stamp")]
        for k, (name, path, value) in enumerate(fields):
            def act(s, k=k, topic=topic, path=path, value=value):
                s.call(reset, s.services[reset]._request_class())
                s.feed(k % 3)
                s.publish(topic, fault_messages.with_value(s.good(topic), path, value))
            yield Case(session.rig.name, topic, kind._type, "at the start " + name, "start", act, True, False)


def clock_cases(session):
    """The simulated clock alone, and with the streams."""
    def make(name, act):
        return Case(session.rig.name, "/clock", "rosgraph_msgs/Clock", name, "clock", act, True, False)

    for seconds in JUMPS_S:
        yield make("all jump %+g s" % seconds, lambda s, seconds=seconds: s.jump(seconds))
        yield make("%+g s for 2 s" % seconds, lambda s, seconds=seconds: s.feed_for(
            2.0, lambda topic, message: [s.good(topic, seconds)] if topic == "/clock" else [message]))
    yield make("stands for 5 s", lambda s: s.feed_for(
        5.0, lambda topic, message: [] if topic == "/clock" else [message]))


def service_cases(session, name, kind):
    """Odd requests, and many at once."""
    short = name.rsplit("/", 1)[1]
    may_change = short in ("set_pose", "datum", "reset", "clear_map", "set_parameters")

    def make(case, act):
        return Case(session.rig.name, name, kind._type, case, "service", act, may_change, may_change)

    def good(s):
        return s.stream.requests().get(short) or kind._request_class()

    yield make("good", lambda s: s.call(name, good(s)))
    for case, path, value in fault_messages.field_cases(good(session)):
        yield make(case, lambda s, path=path, value=value: s.call(
            name, fault_messages.with_value(good(s), path, value)))
    yield make("%d threads, %d calls each" % (CALLERS, CALLS), lambda s: call_at_once(s, name, good(s)))


def call_at_once(session, name, request):
    threads = [threading.Thread(target=lambda: [session.call(name, request) for _ in range(CALLS)], daemon=True)
               for _ in range(CALLERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)


def process_cases(session):
    """Of each node: it is stopped, killed, asked to end. Run at the end."""
    for index, node in enumerate(session.rig.nodes):
        def make(name, act, node=node):
            return Case(session.rig.name, node.name, "process", name, "process", act, True, True)
        yield make("stopped for 1 s", lambda s, i=index: s.pause(i))
        yield make("kill -9 and again", lambda s, i=index: s.end(i, signal.SIGKILL))
        yield make("SIGINT and again", lambda s, i=index: s.end(i, signal.SIGINT))
        yield make("SIGTERM and again", lambda s, i=index: s.end(i, signal.SIGTERM))
    yield Case(session.rig.name, "/", "roscore", "started anew", "process", lambda s: s.restart_master(), True, True)
