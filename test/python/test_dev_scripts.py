#!/usr/bin/env python3
"""What a developer's scripts say of words that they do not know, before anything is built."""
import os
import subprocess
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def run(script, *arguments):
    """Exit code and what was said as an error."""
    done = subprocess.run(["bash", os.path.join(ROOT, "dev", script), *arguments], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, universal_newlines=True, timeout=60, check=False)
    return done.returncode, done.stderr


class UnknownWords(unittest.TestCase):
    """Exit code 2, and what there is."""

    def test_a_target_of_fuzzing(self):
        code, said = run("fuzz.sh", "--seconds", "1", "nmea", "nema")
        self.assertEqual(2, code)
        self.assertIn("no target nema", said)
        self.assertIn(" nmea parameters ", said)

    def test_a_room_of_the_tests(self):
        code, said = run("sanitize.sh", "gnss", "gnsss")
        self.assertEqual(2, code)
        self.assertIn("no room gnsss", said)
        self.assertIn(" gnss kim ", said)

    def test_an_option(self):
        code, said = run("sanitize.sh", "--threads")
        self.assertEqual(2, code)
        self.assertIn("--threads is not an option", said)


if __name__ == "__main__":
    unittest.main()
