"""A master of one's own, the nodes of the package on it, and ends of all their topics, for the live campaign."""
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time
import xmlrpc.client

import campaign
import fault_messages

START_S = 90.0  # of a busy machine
CALLER = "/fault_campaign"
# Lines of a log that say that what was known is given up.
RESET = re.compile(r"^reset:|started anew|starting anew|it is cleared|started from (?!a pose that was set)")


def free_port():
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return probe.getsockname()[1]


class Master:
    """roscore on a port of its own."""

    def __init__(self):
        self.logs = tempfile.mkdtemp(prefix="fault_campaign_")
        self.port = free_port()
        os.environ.update(ROS_MASTER_URI="http://localhost:%d" % self.port, ROS_LOG_DIR=self.logs,
                          ROS_HOSTNAME="localhost", ROSCONSOLE_STDOUT_LINE_BUFFERED="1")
        os.environ.pop("ROS_IP", None)
        self.proxy = xmlrpc.client.ServerProxy(os.environ["ROS_MASTER_URI"])
        self.start()

    def start(self):
        # pylint: disable=consider-using-with
        self.process = subprocess.Popen(["roscore", "-p", str(self.port)], stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL, start_new_session=True)
        try:
            await_(self.answers, "the master")
        except RuntimeError:
            self.stop()
            raise

    def answers(self):
        try:
            return self.proxy.getPid(CALLER)[0] == 1
        except OSError:
            return False

    def stop(self):
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(15.0)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()

    def close(self):
        self.stop()
        shutil.rmtree(self.logs, ignore_errors=True)

    def subscriptions(self, node):
        """{topic: type} as the node itself says."""
        return self._ask(node, "getSubscriptions")

    def publications(self, node):
        return self._ask(node, "getPublications")

    def _ask(self, node, what):
        uri = self.proxy.lookupNode(CALLER, node)[2]
        return dict(getattr(xmlrpc.client.ServerProxy(uri), what)(CALLER)[2])

    def services(self, node):
        return [name for name, nodes in self.proxy.getSystemState(CALLER)[2][2] if node in nodes]


def await_(condition, what, seconds=START_S):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise RuntimeError("waited %.0f s for %s" % (seconds, what))
        time.sleep(0.02)


class Node:
    """One process: the program, its name in the graph, its private parameters."""

    def __init__(self, program, name, parameters=None, arguments=(), package=None, remaps=None):
        self.program, self.name, self.parameters = program, name, parameters or {}
        self.arguments, self.package, self.remaps = list(arguments), package, remaps or {}
        self.process = self.said = None

    def start(self, rospy):
        for key, value in self.parameters.items():
            rospy.set_param(self.name + "/" + key, value)
        space, name = self.name.rsplit("/", 1)
        command = campaign.program(self.program)
        if self.package:
            command = ["rosrun", self.package, self.program]
        elif os.path.isabs(self.program):
            command = [self.program]
        words = self.arguments + ["__name:=" + name, "__ns:=" + (space or "/")]
        words += ["%s:=%s" % remap for remap in self.remaps.items()]
        # pylint: disable=consider-using-with,subprocess-popen-preexec-fn
        self.said = tempfile.TemporaryFile()
        self.process = subprocess.Popen(command + words, stdout=subprocess.DEVNULL, stderr=self.said,
                                        preexec_fn=campaign.limit_memory)

    def is_alive(self):
        return self.process is not None and self.process.poll() is None

    def end(self, how=signal.SIGKILL, seconds=10.0):
        """The code of its end; None where it did not end in time."""
        if self.is_alive():
            self.process.send_signal(how)
        try:
            return self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            return None

    def crash(self):
        """How it died, or nothing."""
        code = self.process.poll()
        if code is None:
            return None
        self.said.seek(0)
        words = self.said.read()[-300:].decode(errors="replace").strip()
        return ("signal " + signal.Signals(-code).name if code < 0 else "exit code %d" % code) + ": " + words


class Ends:
    """Publishers for what the nodes of a rig subscribe to, subscribers for all that they publish. Checks each message
    that comes."""

    def __init__(self, rospy, rig_name):
        self.rospy, self.rig_name = rospy, rig_name
        self.news = threading.Condition()
        self.publishers, self.subscribers = {}, {}
        self.received = {}  # topic: messages since clear()
        self.faults = set()
        self.resets = []
        self.used = None    # fixes used, by the status

    def publisher(self, topic, kind):
        if topic not in self.publishers:
            self.publishers[topic] = self.rospy.Publisher(topic, kind, queue_size=5000, tcp_nodelay=True)
        return self.publishers[topic]

    def subscribe(self, topic, kind, nodes):
        if topic in self.subscribers:
            return
        self.received[topic] = []
        self.subscribers[topic] = self.rospy.Subscriber(topic, kind, self._on_message, (topic, nodes), queue_size=5000,
                                                        tcp_nodelay=True)

    def _on_message(self, message, about):
        topic, nodes = about
        if message._type == "rosgraph_msgs/Log":
            if message.name in nodes and RESET.search(message.msg):
                self.resets.append(message.msg)
            return
        if message._connection_header["callerid"] not in nodes:
            return  # this campaign's own, on a topic that a node publishes, too
        fault = fault_messages.fault_of(message)
        with self.news:
            if fault:
                self.faults.add((fault[0], "%s: %s" % (topic, fault[1])))
            if message._type == "urban_gnss_localization/LocalizationStatus":
                if self.used is not None and message.fixes_used < self.used:
                    self.resets.append("fixes_used went from %d to %d" % (self.used, message.fixes_used))
                self.used = message.fixes_used
            self.received[topic].append(message)
            self.news.notify_all()

    def clear(self):
        with self.news:
            for messages in self.received.values():
                messages.clear()
            self.faults.clear()
            del self.resets[:]

    def wait_for(self, condition, seconds):
        with self.news:
            return self.news.wait_for(condition, seconds)

    def close(self):
        for end in list(self.publishers.values()) + list(self.subscribers.values()):
            end.unregister()
