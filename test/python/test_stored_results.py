"""The tables of the experiments and of a bag in simulation.md are those of the stored results."""
import importlib.util
import json
import os
import re
import sys
import unittest

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
sys.path[:0] = [os.path.join(ROOT, folder) for folder in ("reports", "dev")]


def load(name, folder="reports"):
    """A script as a module."""
    spec = importlib.util.spec_from_file_location(name, os.path.join(ROOT, folder, name + ".py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


plot_bias_experiment, occlusion_report = load("plot_bias_experiment"), load("occlusion_report")
benchmarks = load("benchmarks", "dev")


def read_text(*names):
    """A file of the package."""
    with open(os.path.join(ROOT, *names), encoding="utf-8") as file:
        return file.read()


def stored(name):
    """A result as the program wrote it."""
    return json.loads(read_text("docs", "results", "data", name + ".json"))


class StoredResults(unittest.TestCase):
    """Numbers in the text cannot drift away from the results."""

    def setUp(self):
        """The page, with commands on one line."""
        self.page = read_text("docs", "results", "simulation.md")
        self.commands = re.sub(r",\\\n", ",", self.page)
        self.commands = re.sub(r" *\\\n *", " ", self.commands)

    def test_bias_experiment(self):
        """Every row of every scenario, and the command."""
        results = stored("bias_experiment")
        self.assertIn(results["command"], self.commands)
        self.assertEqual(results["seeds"], list(range(1, 11)))
        for name in results["scenario_order"]:
            rows = [line for line in plot_bias_experiment.table_of(results["scenarios"][name]).splitlines()
                    if line.startswith("| ")]
            self.assertEqual(len(rows), 9, name)
            for row in rows:
                self.assertIn(row, self.page, name)

    def test_shares_that_the_text_names(self):
        """Compensated over conventional, as printed and ours."""
        results = stored("bias_experiment")["scenarios"]

        def share(scenario, phase, ending):
            filters = results[scenario]["filters"]
            return "{:.0f} %".format(100.0 * filters["compensated" + ending][phase]["position_mean_m"]
                                     / filters["standard" + ending][phase]["position_mean_m"])
        text = " ".join(self.page.split())
        self.assertIn("as printed has {} of the conventional one's error".format(
            share("sudden_bias", "before", "_as_printed")), text)
        self.assertIn("as printed it has {} (`building_pass_dgps`) and {} (`building_pass`)".format(
            share("building_pass_dgps", "between", "_as_printed"), share("building_pass", "between", "_as_printed")), text)
        self.assertIn("Ours has {} of our standard filter's error in `building_pass_dgps`, and {} in".format(
            share("building_pass_dgps", "between", ""), share("building_pass", "between", "")), text)

    def test_localizers(self):
        """Every row, the command, and the figures that the README and the method's page quote."""
        results = stored("localizers_dgps")
        self.assertIn(results["command"], self.commands)
        dgps, sudden = (results["scenarios"][name] for name in ("building_pass_dgps", "sudden_bias"))
        for name in dgps:
            cells = []
            for of_name in (dgps[name], sudden[name]):
                diverged = " ({})".format(of_name["diverged"]) if of_name["diverged"] else ""
                cells.append("{:.2f} / {:.1f}{} | {:.2f}".format(of_name["rmse_m"], of_name["max_m"], diverged,
                                                                 of_name["nees_mean"] / 3.0))
            self.assertIn("| `{}` | {} |".format(name, " | ".join(cells)), self.page)
        pairs = ["{:.2f} {} {:.2f} m".format(each["complementary_ekf"]["rmse_m"], "{}", each["imm_ekf"]["rmse_m"])
                 for each in (dgps, sudden)]
        for page, between in (("README.md", "and"), ("docs/methods/kim.md", "m against")):
            text = " ".join(read_text(*page.split("/")).split())
            for pair in pairs:
                self.assertIn(pair.format(between), text, page)

    def test_maier_as_printed_beside_ours(self):
        """Every row of both settings, the command, and the figures of the text."""
        results = stored("occlusion_experiment")
        self.assertIn(results["command"], self.commands)
        self.assertEqual(results["seeds"], list(range(1, 11)))
        tables = (occlusion_report.table_1, occlusion_report.table_2, occlusion_report.table_nees)
        rows = [row for table in tables for row in occlusion_report.markdown(*table(results["scenarios"])).splitlines()]
        self.assertGreater(len(rows), 20)
        for row in rows:
            self.assertIn(row, self.page)
        loop = results["scenarios"]["campus_loop"]
        found, errors = loop["classification"], loop["trajectory"]

        def change(model, base, key):
            return abs(100.0 * (errors[model][key] / errors[base][key] - 1.0))
        text = " ".join(self.page.split())
        self.assertIn("calls {:.0f} % of the fixes right".format(100.0 * found["paper"]["correct"]), text)
        self.assertIn("{:.0f} % nearer to the truth, its heading {:.0f} %".format(
            change("paper", "conventional", "position_mean_m"), change("paper", "conventional", "heading_mean_rad")), text)
        self.assertIn("{:.0f} % in position, and the heading is {:.0f} % worse".format(
            change("paper_as_printed", "conventional_as_printed", "position_mean_m"),
            change("paper_as_printed", "conventional_as_printed", "heading_mean_rad")), text)
        downtown = results["scenarios"]["downtown_grid"]
        errors = downtown["trajectory"]
        self.assertIn("calls {:.0f} % of the good fixes bad".format(
            100.0 * (1.0 - downtown["classification"]["paper_as_printed"]["correct_of_good"])), text)
        self.assertIn("its position is {:.0f} % worse".format(
            change("paper_as_printed", "conventional_as_printed", "position_mean_m")), text)
        self.assertIn("position is {:.0f} % better than the conventional one's, its orientation {:.0f} %".format(
            change("soft", "conventional", "position_mean_m"), change("soft", "conventional", "heading_mean_rad")), text)

    def test_bag_with_lidar(self):
        """Every row of the tables of the bag, and the command."""
        results = stored("occlusion_bag")
        self.assertIn(results["command"], self.commands)
        tables = (occlusion_report.table_1, occlusion_report.table_2, occlusion_report.table_satellites)
        rows = [row for table in tables for row in occlusion_report.markdown(*table(results["scenarios"])).splitlines()]
        self.assertGreater(len(rows), 12)
        for row in rows:
            self.assertIn(row, self.page)

    def test_benchmarks(self):
        """The page is as the script writes it, and holds every row."""
        page, results = read_text("docs", "results", "benchmarks.md"), stored("benchmarks")
        self.assertEqual(benchmarks.of_page(page, results), page)
        for rows in benchmarks.TABLES.values():
            for row in rows:
                for name in [row[1]] + [name for _, name in row[3]]:
                    self.assertIn(name, results["results"])

    def test_what_the_benchmarks_say_where_we_lose(self):
        """A goal that is missed, and a library that is faster."""
        results = {name: {"median_s": seconds} for name, seconds in (("ours", 2e-6), ("faster", 1e-6), ("slow", 0.0123))}
        table = benchmarks.table_of((("work", "ours", 1e-6, (("A", "faster"), ("B", "slow"))),), results)
        self.assertEqual(table.splitlines()[2:], ["| work | 2.00 µs | 1.00 µs, **missed** |  |",
                                                  "| – A | 1.00 µs, × 0.50 | |  |",
                                                  "| – B | 12.3 ms, × 6150 | |  |"])
        self.assertNotIn("missed", benchmarks.table_of((("work", "ours", 2e-6, ()),), results))


if __name__ == "__main__":
    unittest.main()
