"""Collects messages into a Recording, wherever they come from."""

from .messages import READERS, TF_TYPES, add_transforms, frames_of
from .recording import Recording, Stream, Transforms

TF_FULL = 200    # messages of a publisher that are read one by one
TF_EVERY = 20    # of the later ones, each so many


class Collector:
    """Takes messages of the chosen topics and of tf."""

    def __init__(self, chosen, types):
        """`chosen`: {kind: topic}; `types`: {topic: type}."""
        self.kinds = {}
        for kind, topic in chosen.items():
            read_as, read = READERS.get(types.get(topic), (None, None))
            if read_as == kind:
                self.kinds[topic] = (kind, read)
        self.tf_topics = {topic for topic, name in types.items() if name in TF_TYPES}
        self._rows = {topic: [] for topic in self.kinds}
        self._frames = {topic: {} for topic in self.kinds}
        self._children = {topic: {} for topic in self.kinds}
        self._tf_counts = {}
        self.transforms = Transforms()

    def topics(self):
        """Those that are to be read."""
        return list(self.kinds) + sorted(self.tf_topics)

    def wants_transforms(self, topic, publisher):
        """Whether the next tf message is to be read: they are many and all alike."""
        count = self._tf_counts[topic, publisher] = self._tf_counts.get((topic, publisher), 0) + 1
        return count <= TF_FULL or count % TF_EVERY == 0 or topic.endswith("static")

    def add_transforms(self, topic, message, publisher):
        """A tf message."""
        add_transforms(self.transforms, message, publisher, topic.endswith("static"))

    def add(self, topic, message, received):
        """A message of one of the chosen topics."""
        _, read = self.kinds[topic]
        self._rows[topic].append(read(message, received))
        frame, child = frames_of(message)
        frames, children = self._frames[topic], self._children[topic]
        frames[frame] = frames.get(frame, 0) + 1
        children[child] = children.get(child, 0) + 1

    def recording(self, name, topics, begin, end, is_live=False):
        """All that came."""
        streams = {kind: Stream(kind, topic, self._rows[topic], self._frames[topic], self._children[topic])
                   for topic, (kind, _) in self.kinds.items()}
        return Recording(name, topics, streams, self.transforms, begin, end, is_live)
