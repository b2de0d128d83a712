"""doctor/watch says how the localizers are."""
import contextlib
import importlib.machinery
import importlib.util
import io
import os
import subprocess
import unittest
from types import SimpleNamespace

PATH = os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "..", "doctor", "watch")
LOADER = importlib.machinery.SourceFileLoader("watch", PATH)
watch = importlib.util.module_from_spec(importlib.util.spec_from_loader("watch", LOADER))
LOADER.exec_module(watch)


def array(*statuses):
    """A DiagnosticArray of (name, level, message)."""
    return SimpleNamespace(status=[SimpleNamespace(name=name, level=level, message=message)
                                   for name, level, message in statuses])


class WatchTest(unittest.TestCase):
    def say(self, stays, *arrays):
        """The Watch, and what it printed of the arrays."""
        one = watch.Watch(stays, False)
        with contextlib.redirect_stdout(io.StringIO()) as out:
            for each in arrays:
                one.take(each)
        return one, out.getvalue()

    def test_only_localizers(self):
        one, said = self.say(True, array(("battery: voltage", 2, "low"), ("imm_ekf: localization", 0, "OK: 1.2 m")))
        self.assertRegex(said, r"^\d\d:\d\d:\d\d  imm_ekf: OK: 1\.2 m\n$")
        self.assertEqual(one.exit_code(), watch.ALL_OK)

    def test_exit_code_is_of_the_last_line_of_each(self):
        one, _ = self.say(True, array(("a: localization", 1, "")), array(("a: localization", b"\0", "")))
        self.assertEqual(one.exit_code(), watch.ALL_OK)
        one.take(array(("b: localization", b"\2", "")))
        self.assertEqual(one.exit_code(), watch.NOT_OK)
        self.assertEqual(watch.Watch(True, False).exit_code(), watch.NOTHING)

    def test_a_line_renews_itself_until_the_level_changes(self):
        ok, warn = array(("a: localization", 0, "x")), array(("a: localization", 1, "y"))
        _, said = self.say(False, ok, ok, warn, warn, ok)
        self.assertEqual(said.count("\033[A"), 2)
        self.assertNotIn("\033", self.say(True, ok, ok)[1])

    def test_it_ends_with_who_reads_it(self):
        """watch | head."""
        class Closed(io.StringIO):
            def write(self, text):
                raise BrokenPipeError
        one = watch.Watch(True, False)
        with contextlib.redirect_stdout(Closed()):
            one.take(array(("a: localization", 0, "x"), ("b: localization", 0, "y")))
        self.assertFalse(one.is_read)

    def test_without_a_master(self):
        done = subprocess.run([PATH, "--seconds", "1"], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              universal_newlines=True, timeout=60,
                              env=dict(os.environ, ROS_MASTER_URI="http://localhost:9"))
        self.assertEqual((done.returncode, done.stdout), (watch.NOTHING, ""))
        self.assertIn("no ROS master at http://localhost:9", done.stderr)


if __name__ == "__main__":
    unittest.main()
