"""Topics of a running robot as a Recording."""

import threading
import time

import rosgraph
import rospy

from .collector import Collector
from .messages import READERS, TF_TYPES
from .recording import Topic
from .topic_choice import choose

POLL_S = 0.1
WAIT_FOR_MASTER = "no ROS master at {}: is the robot running? (ROS_MASTER_URI)"


class NoMaster(Exception):
    """The message says where none is."""


class LiveReader:
    """Listens for some seconds."""

    def __init__(self, wanted):
        if not rosgraph.is_master_online():
            raise NoMaster(WAIT_FOR_MASTER.format(rosgraph.get_master_uri()))
        rospy.init_node("doctor", anonymous=True, disable_signals=True)
        self._lock = threading.Lock()
        self._types = {name: type_name for name, type_name in rospy.get_published_topics()}
        for name, type_name in rosgraph.Master("/doctor").getTopicTypes():
            if type_name != "*":
                self._types.setdefault(name, type_name)
        self._counts = {name: 0 for name in self._types}
        everything = [Topic(name, type_name, 1) for name, type_name in sorted(self._types.items())]
        self.choices = choose(everything, {kind: rospy.resolve_name(topic) if topic else None
                                           for kind, topic in wanted.items()})
        self._collector = Collector({kind: topic for kind, (topic, _) in self.choices.items()}, self._types)
        self._trouble = []

    def run(self, seconds, report=lambda share: None):
        """The recording of the next seconds, by the wall clock: /clock may stand still."""
        subscribers = []
        begin = time.time()
        for topic, type_name in self._types.items():
            if type_name in READERS or type_name in TF_TYPES:
                subscribers.append(rospy.Subscriber(topic, rospy.AnyMsg, self._on_message, (topic, begin), 1000))
        while time.time() < begin + seconds and not rospy.is_shutdown():
            report((time.time() - begin) / seconds)
            time.sleep(POLL_S)
        for subscriber in subscribers:
            subscriber.unregister()
        with self._lock:
            # Of topics that were not listened to, only that they are there is known.
            topics = [Topic(name, self._types[name], self._counts[name] if self._listened(name) else 1)
                      for name in sorted(self._types)]
            now = self._now()
            recording = self._collector.recording("live, " + rosgraph.get_master_uri(), topics, now - seconds, now,
                                                  True)
        recording.choices = self.choices
        recording.trouble = self._trouble
        return recording

    def _listened(self, topic):
        return self._types[topic] in READERS or self._types[topic] in TF_TYPES

    @staticmethod
    def _now():
        """ROS time where there is some (a simulation's), else the wall clock's."""
        now = rospy.get_rostime().to_sec()
        return now if now > 0.0 else time.time()

    def _on_message(self, data, where):
        topic, _ = where
        now = self._now()
        with self._lock:
            self._counts[topic] += 1
            is_tf = topic in self._collector.tf_topics
            publisher = data._connection_header.get("callerid", "")
            if is_tf and not self._collector.wants_transforms(topic, publisher):
                return
            if not is_tf and topic not in self._collector.kinds:
                return
            try:
                message = message_class(data._connection_header)()
                message.deserialize(data._buff)
                if is_tf:
                    self._collector.add_transforms(topic, message, publisher)
                else:
                    self._collector.add(topic, message, now)
            except Exception as error:  # genpy raises whatever struct does
                text = "{}: a message could not be read: {}".format(topic, error)
                if text not in self._trouble:
                    self._trouble.append(text)


_CLASSES = {}


def message_class(header):
    """The class of a connection's messages, made of the definition that travels with it."""
    key = header["type"], header["md5sum"]
    if key not in _CLASSES:
        import genpy.dynamic
        _CLASSES[key] = genpy.dynamic.generate_dynamic(header["type"], header["message_definition"])[header["type"]]
    return _CLASSES[key]
