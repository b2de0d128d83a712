"""A bounded run of dev/damage_campaign.py: damaged files end no program by a signal, nor without a word about them.

URBAN_GNSS_PROGRAMS names the folder of the programs."""
import os
import random
import sys
import unittest

import test_tools

sys.path.insert(0, os.path.join(test_tools.PACKAGE, "dev"))
import damage_campaign  # noqa: E402

CASES = 100


class DamageTest(unittest.TestCase):
    def test_the_same_seed_gives_the_same_files(self):
        data = b"POINTS 3\nDATA ascii\n1 2 3\n" + bytes(range(256))
        for damage in set(damage_campaign.OF_TEXT + damage_campaign.OF_BINARY):
            one, two = (damage(random.Random(7), data) for _ in range(2))
            self.assertEqual(one, two, damage.__name__)
            many = {damage(random.Random(seed), data) for seed in range(50)}
            self.assertGreater(len(many - {data}), 3, damage.__name__)

    @unittest.skipUnless(test_tools.PROGRAMS, "URBAN_GNSS_PROGRAMS is not set")
    def test_no_fault(self):
        os.environ["ROS_PACKAGE_PATH"] = test_tools.PACKAGE + ":" + os.environ.get("ROS_PACKAGE_PATH", "")
        table, faults = damage_campaign.run(CASES, seed=2, jobs=os.cpu_count() or 1, report=lambda fault: None)
        self.assertEqual(faults, [], "\n".join(faults))
        self.assertEqual(sum(sum(counts.values()) for counts in table.values()), CASES)


if __name__ == "__main__":
    unittest.main()
