#!/usr/bin/env python3
"""How long a live localizer takes from a fix to the odometry/filtered that has it.

    make -C .workspace/build latency_probe
    dev/latency.py --localizer imm_ekf --seconds 30

On a master of its own: a robot drives straight ahead, with odometry at 50 Hz and fixes at 5 Hz. A fix goes out with the
stamp of the odometry that follows at once. Prints median, 99 % and largest time (ms) from sending to receiving: of fixes
and of the odometry between them, and, beside them, of odometry through a node that only repeats it, which is what the
way through any node takes. benchmark/ros/latency_probe.cpp sends and receives.
"""
import argparse
import subprocess

import campaign
import fault_graph
import rospy


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--localizer", default="imm_ekf")
    parser.add_argument("--seconds", type=int, default=30)
    options = parser.parse_args()
    master = fault_graph.Master()
    nodes = [fault_graph.Node(options.localizer + "_node", "/localizer"),
             fault_graph.Node("latency_probe", "/latency_repeater")]
    try:
        for node in nodes:
            node.start(rospy)
        subprocess.run(campaign.program("latency_probe") + [str(options.seconds)], check=True)
    finally:
        for node in nodes:
            node.end()
        master.close()


if __name__ == "__main__":
    main()
