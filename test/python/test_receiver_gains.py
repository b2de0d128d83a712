"""receiver_gains.py: the whole of it with programs that only pretend, and its stored tables against the other page's."""
import importlib.util
import os
import subprocess
import sys
import tempfile
import unittest

import programs
from test_compare_localizers import EVALUATE, REPLAY

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
SCRIPT = os.path.join(ROOT, "reports", "receiver_gains.py")
sys.path.insert(0, os.path.dirname(SCRIPT))
spec = importlib.util.spec_from_file_location("receiver_gains", SCRIPT)
report = importlib.util.module_from_spec(spec)
spec.loader.exec_module(report)

ROW = {report.BOTH: "nothing", report.VELOCITY: "ranges of the fix", report.SATELLITES: "velocity of the receiver"}


def read(*names):
    """A page's text."""
    with open(os.path.join(ROOT, "docs", *names), encoding="utf-8") as file:
        return file.read()


def tables_of(text, name):
    """The cells of the tables between two markers, by first and top cell."""
    found, header = {}, []
    for line in text.split("<!-- {} -->".format(name))[1].split("<!-- end of")[0].splitlines():
        cells = [cell.strip().strip("`") for cell in line.split("|")[1:-1]]
        if not cells:
            header = []
        elif not header:
            header = cells
        else:
            found.update({(cells[0], top): cell for top, cell in zip(header, cells)})
    return found


class ReceiverGainsTest(unittest.TestCase):
    def test_the_pages_agree_with_what_each_source_is_worth(self):
        """A fix's ranges are its satellites' residuals: leaving out either source is a row of both tables."""
        ablation = tables_of(read("results", "recordings.md"), "ablation")
        for page, (named, rows) in report.PAGES.items():
            found = tables_of(read("receivers", page + ".md"), "gains")
            for row in rows:
                if row in ROW:
                    for name, heading in named.items():
                        expected = ", ".join(ablation[ROW[row], name].split(" / ")[:2])
                        self.assertEqual(found[row, heading], expected, name + ", " + row)

    def test_writes_the_tables(self):
        with tempfile.TemporaryDirectory() as directory:
            programs.pretend(directory, evaluate=EVALUATE, replay=REPLAY, csv_to_bag=programs.CSV_TO_BAG)
            for name in [name for named, _ in report.PAGES.values() for name in named]:
                folder = os.path.join(directory, "data", name)
                os.makedirs(folder)
                for file in ("gnss.csv", "odom.csv", "truth.csv", "meta.json"):
                    open(os.path.join(folder, file), "w").close()
            for page in report.PAGES:
                with open(os.path.join(directory, page + ".md"), "w") as file:
                    file.write("<!-- gains -->\n<!-- end of gains -->\n")
            done = subprocess.run([sys.executable, "-B", SCRIPT, os.path.join(directory, "out"), "--data",
                                   os.path.join(directory, "data"), "--docs", directory],
                                  stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True,
                                  env=dict(os.environ, URBAN_GNSS_PROGRAMS=directory))
            self.assertEqual(done.returncode, 0, done.stderr)
            with open(os.path.join(directory, "mavros.md")) as file:
                text = file.read()
            # An error is as large as the name of its run is long.
            self.assertIn("| velocity | `--satellites-topic \"\"` | 8.0, 8.0 |\n"
                          "| neither | `--velocity-topic \"\" --satellites-topic \"\"` | 7.0, 7.0 |\n"
                          "| the fixes themselves |  | 7.0, 7.0 |", text)


if __name__ == "__main__":
    unittest.main()
