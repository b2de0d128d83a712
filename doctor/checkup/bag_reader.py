"""Bags as a Recording."""

import os
import sys

import rosbag

from .collector import Collector
from .recording import Topic
from .topic_choice import choose

PROGRESS_EVERY = 100000  # messages, a line on a terminal


class UnreadableBag(Exception):
    """The message names the file and says what to do."""


def open_bag(path):
    """An open bag, or UnreadableBag."""
    try:
        return rosbag.Bag(path)
    except rosbag.ROSBagUnindexedException:
        raise UnreadableBag("{}: has no index, for its recording was cut off: rosbag reindex {}".format(path, path))
    except rosbag.ROSBagException as error:
        raise UnreadableBag("{}: is no bag that can be read ({}); if it was cut off: rosbag reindex {}".format(
            path, str(error) or type(error).__name__, path))
    except OSError as error:
        raise UnreadableBag("{}: {}".format(path, error.strerror or error))
    except Exception as error:  # rosbag lets errors of struct, bz2 and others through where a file is damaged
        raise UnreadableBag("{}: is no bag, or damaged ({})".format(path, error))


def topics_of(bags):
    """All topics with their types and counts."""
    found = {}
    for bag in bags:
        for name, info in bag.get_type_and_topic_info().topics.items():
            count = info.message_count + (found[name].count if name in found else 0)
            found[name] = Topic(name, info.msg_type, count)
    return [found[name] for name in sorted(found)]


def read_bags(paths, wanted):
    """The recording in one or several bags (in the order of time). `wanted`: topics by kind, as of topic_choice."""
    bags = [open_bag(path) for path in paths]
    try:
        bags = [bag for bag in bags if bag.get_message_count() > 0]
        bags.sort(key=lambda bag: bag.get_start_time())
        topics = topics_of(bags)
        choices = choose(topics, wanted)
        collector = Collector({kind: topic for kind, (topic, _) in choices.items()},
                              {topic.name: topic.type for topic in topics})
        trouble = []
        for bag in bags:
            trouble += read_into(collector, bag)
        begin = bags[0].get_start_time() if bags else 0.0
        end = max(bag.get_end_time() for bag in bags) if bags else 0.0
        recording = collector.recording(", ".join(os.path.basename(path) for path in paths), topics, begin, end)
        recording.choices = choices
        recording.trouble = trouble
        return recording
    finally:
        for bag in bags:
            bag.close()


def read_into(collector, bag):
    """All messages of a bag; a list of what went wrong."""
    count, total = 0, max(bag.get_message_count(topic_filters=collector.topics() or None), 1)
    shows_progress = sys.stderr.isatty()
    trouble, bad = [], {}
    try:
        if not collector.topics():
            return trouble
        messages = bag.read_messages(topics=collector.topics(), raw=True, return_connection_header=True)
        for topic, (_, data, _, _, message_type), stamp, header in messages:
            count += 1
            if shows_progress and count % PROGRESS_EVERY == 0:
                sys.stderr.write("\r{:3.0f} %".format(100.0 * count / total))
            is_tf = topic in collector.tf_topics
            publisher = header.get("callerid", b"")
            if is_tf and not collector.wants_transforms(topic, publisher):
                continue
            try:
                message = message_type()
                message.deserialize(data)
                if is_tf:
                    collector.add_transforms(topic, message, text_of(publisher))
                else:
                    collector.add(topic, message, stamp.to_sec())
            except Exception as error:  # one damaged message; genpy raises whatever struct does
                bad.setdefault(topic, [0, error])[0] += 1
    except Exception as error:  # a damaged chunk: struct, bz2, lz4 and rosbag each raise their own
        trouble.append("{}: reading ended after {} of {} messages: {}".format(bag.filename, count, total, error))
    if shows_progress:
        sys.stderr.write("\r     \r")
    trouble += ["{}: {} messages could not be read: {}".format(topic, n, error) for topic, (n, error) in bad.items()]
    return trouble


def text_of(value):
    """Header fields of a bag, which are bytes or text."""
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)
