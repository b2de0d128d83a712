"""What the tests of a localizer's inputs share: its last answers, and waiting for them."""
import threading
import unittest

import rospy


class LocalizerCase(unittest.TestCase):
    def setUp(self):
        self.changed = threading.Condition()
        self.status, self.estimate = None, None

    def on_status(self, message):
        with self.changed:
            self.status = message
            self.changed.notify_all()

    def on_estimate(self, message):
        with self.changed:
            self.estimate = message
            self.changed.notify_all()

    def wait(self, condition, what):
        with self.changed:
            self.assertTrue(self.changed.wait_for(condition, 10.0), what)

    def connect(self, ends):
        """Waits until each publisher and subscriber has somebody at its other end."""
        deadline = rospy.Time.now() + rospy.Duration(10.0)
        while not all(end.get_num_connections() for end in ends):
            self.assertLess(rospy.Time.now(), deadline, "no connection")
            rospy.sleep(0.01)
