#!/usr/bin/env python3
"""Gives the live nodes messages that no sensor should send, and counts what goes wrong.

usage: fault_campaign.py [--cases N] [--seconds S] [--seed 1] [--rigs NODE ...] [--only TEXT] [--list]

Starts the nodes on a master of its own, feeds a good stream in lockstep (stamps of its own; nothing sleeps), and puts
one odd message after the other in between: each field of each type that a node subscribes to, as NaN, infinite, the
largest number, 0, -1, empty, huge; bytes that are no message; stamps and streams that are odd; clocks that jump; odd
requests to each service; signals. After each case good messages follow. Faults are: a crash; a published number that is
not finite; a negative variance; a reset after one odd message; no answer any more (hang); an estimate that stays more
than 8 m off. Each fault is tried again on a fresh node, alone or with the cases before it, and printed. Exits with 1
where there was one.

--only takes what has TEXT in its name, which is "NODE TOPIC TYPE CASE". The same seed gives the same cases in the same
order. With --cases or --seconds each node has its share of them. The workspace must be sourced; URBAN_GNSS_PROGRAMS may
be the folder of the built programs.
"""
import argparse
import collections
import os
import random
import signal
import sys
import threading
import time
import xmlrpc.client

import genpy.message

import campaign
import fault_cases
import fault_graph
import fault_messages

ANSWER_S = 0.5       # of wall time, for the answer to a batch
LAST_ANSWER_S = 10.0
SHORT_S = 0.05       # after which the next batch goes on
BATCHES = 120        # of good messages, after which no answer is a hang
FURTHEST_M = 8.0     # of the estimate from the truth
MOST_FAULTS = 3      # that are tried again, of one kind and type
VERDICTS = ("crash", "non-finite", "negative variance", "reset", "hang", "off")
RECOVERIES = ("recovery from one, s", "from more, s")  # the worst
TOGETHER = 5         # odd messages, before what came of them is judged; each by itself, if something did
BETWEEN = 2          # good moments between them
SETTLE = 6           # batches, after which a reset has been said
HISTORY = (1, 3, 10, 40)
OTHERS_SERVICES = ("set_logger_level", "get_loggers", "load_nodelet", "unload_nodelet", "list")  # of ROS itself


class Session:
    """A rig whose nodes run, and what has come of the case at hand."""

    def __init__(self, rospy, master, rig, seed):
        self.rospy, self.master, self.rig, self.seed = rospy, master, rig, seed
        self.ends = fault_graph.Ends(rospy, rig.name)
        self.notes = []

    # --- the nodes

    def start(self):
        """All nodes anew, until they answer."""
        for node in self.rig.nodes:
            if node.is_alive():
                node.end()
        self.stream = self.rig.stream_type("/" + self.rig.name, self.seed)
        if self.stream.simulated_time:
            self.rospy.set_param("/use_sim_time", True)
        for node in self.rig.nodes:
            node.start(self.rospy)
        self.connect()
        self.warm_up()

    def connect(self):
        """Ends of all that the nodes subscribe to and publish."""
        import rosservice
        nodes = [node.name for node in self.rig.nodes]
        fault_graph.await_(self.is_complete, "the nodes of " + self.rig.name)
        self.subscriptions, self.services = {}, {}
        for node in nodes:
            for topic, kind in self.master.subscriptions(node).items():
                kind = type(self.good(topic)) if kind == "*" else genpy.message.get_message_class(kind)
                self.subscriptions[topic] = kind
                self.ends.publisher(topic, kind)
            for topic, kind in self.master.publications(node).items():
                self.ends.subscribe(topic, genpy.message.get_message_class(kind), nodes)
            for name in self.master.services(node):
                if name.rsplit("/", 1)[1] not in OTHERS_SERVICES:
                    self.services[name] = rosservice.get_service_class_by_name(name)
        fault_graph.await_(self.is_connected, "connections of " + self.rig.name)

    def is_complete(self):
        """Whether each node has subscribed to all that it will."""
        for node in self.rig.nodes:
            if not node.is_alive():
                raise RuntimeError("%s: %s" % (node.name, node.crash()))
        try:
            found = [self.master.subscriptions(node.name) for node in self.rig.nodes]
            publications = [self.master.publications(node.name) for node in self.rig.nodes]
        except (OSError, TypeError, xmlrpc.client.Fault):  # it is not there yet, or not yet all there
            return False
        topics = {topic for each in found for topic in each}
        wanted = set(self.rig.answers)
        self.last_seen, before = (found, publications), getattr(self, "last_seen", None)
        time.sleep(0.2)
        return bool(topics) and wanted <= {t for each in publications for t in each} and before == self.last_seen

    def is_connected(self):
        return (all(self.ends.publishers[topic].get_num_connections() > 0 for topic in self.subscriptions)
                and all(self.ends.subscribers[topic].get_num_connections() > 0 for topic in self.rig.answers))

    def warm_up(self):
        self.repair()
        for _ in range(BATCHES):
            self.feed(self.stream.warm_steps // 8)
            if self.is_answered(ANSWER_S) and self.is_well():
                break
        else:
            raise RuntimeError(self.rig.name + " gives no answer to good messages")
        self.feed(self.stream.warm_steps // 2)
        self.is_answered(LAST_ANSWER_S)

    def close(self):
        for node in self.rig.nodes:
            if node.is_alive():
                node.end()
        self.ends.close()
        if self.rospy.has_param("/use_sim_time"):
            self.rospy.delete_param("/use_sim_time")

    # --- what cases do

    def local(self, topic):
        prefix = "/" + self.rig.name + "/"
        return topic[len(prefix):] if topic.startswith(prefix) else topic

    def good(self, topic, later_s=0.0):
        """A good message between the last and the next."""
        return self.stream.make(self.local(topic), 0.2 * self.stream.period + later_s)

    def fed_topics(self):
        """That the stream has, and a node subscribes to."""
        probe = self.rig.stream_type("/" + self.rig.name, self.seed)
        topics = {topic for _ in range(2 * probe.warm_steps) for topic in self.names_of(probe)}
        return topics & set(self.subscriptions) - {"/clock"}

    def names_of(self, probe):
        probe.index += 1
        return [topic if topic.startswith("/") else "/%s/%s" % (self.rig.name, topic) for topic in probe.topics()]

    def publish(self, topic, *messages):
        for message in messages:
            self.ends.publishers[topic].publish(message)

    def feed(self, steps, alter=None):
        """The next messages; alter(topic, message): what is published in the place of each."""
        for _ in range(steps):
            for topic, message in self.stream.step():
                if topic in self.ends.publishers:
                    self.publish(topic, *([message] if alter is None else alter(topic, message)))

    def feed_for(self, seconds, alter):
        self.feed(int(seconds / self.stream.period), alter)

    def jump(self, seconds):
        self.stream.now += seconds

    def call(self, name, request):
        """A service, which must answer in time."""
        done = threading.Event()

        def run():
            try:
                kind = self.services[name]
                response = self.rospy.ServiceProxy(name, kind)(request)
                fault = fault_messages.fault_of(response)
                if fault:
                    self.notes.append((fault[0], "answer of %s: %s" % (name, fault[1])))
            except (self.rospy.ServiceException, self.rospy.ROSSerializationException):
                pass
            done.set()
        threading.Thread(target=run, daemon=True).start()
        if not done.wait(LAST_ANSWER_S):
            self.notes.append(("hang", "no answer of " + name))

    def pause(self, index):
        process = self.rig.nodes[index].process
        process.send_signal(signal.SIGSTOP)
        self.feed(self.stream.steps)
        time.sleep(1.0)
        process.send_signal(signal.SIGCONT)

    def end(self, index, how):
        """And a start anew; a node that is asked to end does so in time, and not by a fault of its own."""
        node = self.rig.nodes[index]
        code = node.end(how)
        if code is None:
            self.notes.append(("hang", "%s goes on after %s" % (node.name, how.name)))
        elif code not in (0, -how):
            self.notes.append(("crash", "%s ends with %d after %s" % (node.name, code, how.name)))
        node.start(self.rospy)
        self.connect()

    def restart_master(self):
        """Its topics stay connected, and the nodes go on."""
        self.master.stop()
        self.feed(self.stream.steps)
        self.master.start()

    def repair(self):
        """A user says what is right."""
        for topic in sorted(self.rig.commands):
            if topic in self.subscriptions:
                self.publish(topic, self.good(topic))
        for name in self.services:
            short = name.rsplit("/", 1)[1]
            if short in ("datum", "set_pose", "set_parameters"):
                self.call(name, self.stream.requests()[short])

    # --- what is checked

    def crashes(self):
        return [("crash", node.name + ": " + node.crash()) for node in self.rig.nodes if node.crash()]

    def is_answered(self, seconds):
        """Whether each answer to what was fed has come."""
        return self.ends.wait_for(lambda: all(map(self.has_answer, self.rig.answers)) or self.crashes(), seconds)

    def has_answer(self, topic):
        how, came = self.rig.answers[topic], self.ends.received.get(topic, ())
        if how == "count":
            return len(came) >= self.fed
        due = self.stream.now - (self.stream.period if how == "late" else 0.0) - 1e-6
        return any(message.header.stamp.to_sec() >= due and message.header.stamp.to_sec() < due + 5.0
                   for message in came[-50:])

    fed = 1

    def is_well(self):
        """Whether the estimate is where the robot is."""
        return not self.rig.finds_place or self.error_m() < FURTHEST_M

    def error_m(self):
        (topic, _), = self.rig.answers.items()
        came = self.ends.received[topic]
        if not came:
            return float("inf")
        position, (x, y, _) = came[-1].pose.pose.position, self.stream.truth()
        return ((position.x - x) ** 2 + (position.y - y) ** 2) ** 0.5

    def recover(self):
        """Good messages until they are answered, and the estimate is right: (recovery in s of the stamps, or None)."""
        start = self.stream.now
        with self.ends.news:
            for topic in self.rig.answers:
                self.ends.received[topic].clear()
        was_answered = None
        for batch in range(BATCHES):
            self.feed(self.stream.steps)
            answered = self.is_answered(LAST_ANSWER_S if batch == BATCHES - 1 else SHORT_S)
            if self.crashes():
                return None
            if answered and was_answered is None:
                was_answered = self.first_answer(start)
            if answered and self.is_well():
                return was_answered
        if was_answered is None:
            self.notes.append(("hang", "no answer to %d good moments" % (BATCHES * self.stream.steps)))
        else:
            self.notes.append(("off", "the estimate is %.0f m off" % self.error_m()))
        return None

    def first_answer(self, start):
        """s, from the first good message to the first that was answered."""
        longest = 0.0
        for topic, how in self.rig.answers.items():
            if how == "count":
                continue
            stamps = [message.header.stamp.to_sec() for message in self.ends.received[topic]]
            after = [stamp - start - self.stream.period for stamp in stamps if stamp > start]
            longest = max(longest, min(after, default=0.0))  # what was asked before a jump may come later
        return longest

    def run(self, *cases):
        """([(verdict, where)], recovery in s) of one case, or of several that are each one odd message."""
        self.ends.clear()
        del self.notes[:]
        for case in cases:
            case.act(self)
            self.feed(BETWEEN if len(cases) > 1 else 0)
        recovery = self.recover() if not case.is_command else self.recover_after_command()
        faults = set(self.crashes()) | set(self.notes) | set(self.ends.faults)
        if case.may_reset or (case.is_command and self.ends.resets):
            self.settle()
        elif self.ends.resets:
            faults.add(("reset", self.ends.resets[0][:200]))
        return sorted(faults), recovery

    def settle(self):
        """What a node says late of a reset must not be laid to the next case."""
        if not self.crashes():
            self.feed(SETTLE * self.stream.steps)
            self.is_answered(ANSWER_S)
            time.sleep(0.05)

    def recover_after_command(self):
        self.feed(self.stream.steps)
        self.is_answered(ANSWER_S / 5)
        if not self.crashes():
            self.repair()
        return self.recover()


class Campaign:
    """All rigs; {(rig, type): counts}, and the faults as texts."""

    def __init__(self, options, report=print):
        self.options, self.report = options, report
        self.table, self.faults, self.retried = {}, [], collections.Counter()

    def run(self):
        master = fault_graph.Master()
        try:
            import rospy
            rospy.init_node("fault_campaign", disable_signals=True, disable_rosout=True, log_level=rospy.FATAL)
            import fault_receivers
            import fault_rigs
            rigs = fault_receivers.receiver_rigs() + fault_rigs.all_rigs()
            wanted = [rig for rig in rigs if not self.options.rigs or rig.name in self.options.rigs]
            self.seconds_left = self.options.seconds or 1e9
            self.left = self.options.cases
            for number, rig in enumerate(wanted):
                self.run_rig(rospy, master, rig, len(wanted) - number)
        finally:
            master.close()

    def run_rig(self, rospy, master, rig, rigs_left):
        most = -(-self.left // rigs_left)
        session = Session(rospy, master, rig, self.options.seed)
        try:
            session.start()
            begin = time.monotonic()
            groups = self.groups_of(session)
            count = sum(map(len, groups))
            if self.options.list:
                self.report("\n".join(fault_cases.full_name(case) for group in groups for case in group))
                return
            done = []
            for group in groups:
                if time.monotonic() > begin + self.seconds_left / rigs_left or len(done) >= most:
                    break
                self.several(session, group, done)
            self.left -= len(done)
            self.seconds_left -= time.monotonic() - begin
            self.report("%s: %d of %d cases in %.0f s" % (rig.name, len(done), count, time.monotonic() - begin))
        finally:
            session.close()

    def groups_of(self, session):
        """The cases of a rig in the order of the seed: odd messages some at a time, all others alone."""
        def wanted(cases):
            return [case for case in cases if self.options.only in fault_cases.full_name(case)]

        def is_one_message(case):
            return case.group == "field" and not case.is_command

        numbers = random.Random("%d %s" % (self.options.seed, session.rig.name))
        cases = wanted(fault_cases.all_cases(session, self.options.seed))
        numbers.shuffle(cases)
        messages = [case for case in cases if is_one_message(case)]
        groups = [messages[k:k + TOGETHER] for k in range(0, len(messages), TOGETHER)]
        groups += [[case] for case in cases if not is_one_message(case)]
        numbers.shuffle(groups)
        if session.rig.only is None:
            groups += [[case] for case in wanted(fault_cases.process_cases(session))]
        return groups

    def several(self, session, group, done):
        faults, recovery = session.run(*group) if len(group) > 1 else (None, None)
        if faults == []:
            for case in group:
                self.count(case, recovery, done)
            return
        known = len(self.faults)
        if faults:
            session.start()
        for case in group:
            self.one(session, case, done)
        if faults and len(self.faults) == known:
            self.note(group, faults)

    def count(self, case, recovery, done):
        done.append(case)
        row = self.table.setdefault((case.rig, case.kind), collections.Counter())
        row["cases"] += 1
        which = RECOVERIES[case.may_reset]
        row[which] = max(row[which], recovery or 0.0)

    def note(self, cases, faults):
        """What cases ended in; of several, together, in the row of the last."""
        row = self.table[cases[-1].rig, cases[-1].kind]
        for verdict in {verdict for verdict, _ in faults}:
            row[verdict] += 1
        self.faults.append("%s: %s" % ("\n  and ".join(map(fault_cases.full_name, cases)),
                                       "; ".join("%s (%s)" % fault for fault in faults)))
        self.report(self.faults[-1])

    def one(self, session, case, done):
        faults, recovery = session.run(case)
        self.count(case, recovery, done)
        if not faults:
            return
        self.note([case], faults)
        kinds = {verdict for verdict, _ in faults}
        key = (case.rig, case.kind, min(kinds))
        self.retried[key] += 1
        if self.retried[key] <= MOST_FAULTS:
            self.report("  " + self.minimal(session, case, done, kinds))
        else:
            session.start()

    def minimal(self, session, case, done, kinds):
        """The fewest cases, of those that were tried, that end in the same fault on a fresh node."""
        for length in HISTORY:
            session.start()
            for each in done[-length:]:
                faults, _ = session.run(each)
            if kinds & {verdict for verdict, _ in faults}:
                session.start()
                before = ["\n    " + fault_cases.full_name(each) for each in done[-length:-1]]
                return "again with --only '%s'%s" % (
                    fault_cases.full_name(case), " after" + "".join(before) if before else ", alone")
        session.start()
        return "not again on a fresh node, nor with the %d cases before" % (HISTORY[-1] - 1)


def show(table):
    """The table as lines of text."""
    rows, total = [], collections.Counter()
    for (rig, kind), counts in table.items():
        rows.append(row_of(rig, kind, counts))
        for name, count in counts.items():
            total[name] = max(total[name], count) if name in RECOVERIES else total[name] + count
    head = ("node", "type", "cases") + VERDICTS + RECOVERIES
    return campaign.table_of(head, rows + [row_of("all", "", total)])


def row_of(rig, kind, counts):
    return [rig, kind, counts["cases"]] + [counts[verdict] for verdict in VERDICTS] + [
        "%.2f" % counts[name] for name in RECOVERIES]


def main():
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=1000000, help="at most")
    parser.add_argument("--seconds", type=float, help="of cases, after which it ends; starts of nodes are not counted")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help='cases that have this in "NODE TOPIC TYPE CASE"')
    parser.add_argument("--rigs", nargs="+", default=[], help="of these nodes alone")
    parser.add_argument("--list", action="store_true", help="the cases, without a run")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(2))  # and no node is left behind
    work = Campaign(options, lambda text: print(text, flush=True))
    try:
        work.run()
    finally:
        print(show(work.table))
    sys.stdout.flush()
    os._exit(1 if work.faults else 0)  # threads of rospy that wait for a hung node do not end


if __name__ == "__main__":
    main()
