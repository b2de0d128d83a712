#!/usr/bin/env bash
# Builds the package and shows what it does: a drive through a simulated city with the recommended localizer beside a plain
# EKF and the raw fix; the field of Nishida, Inoue and Sagara (2013) driven live by the nodes; their simulation with all
# methods over many seeds. Writes a report of each; the last leads to the other two.
#
#   scripts/demo.sh [--quick] [--seeds N] [--rviz] [--output DIR]
#
#   --quick       4 seeds and one live lap instead of 30 and three
#   --seeds N     so many seeds
#   --rviz        show the live part in rviz (where DISPLAY is set)
#   --output DIR  folder of the results (default results/demo of this clone; with --quick results/demo_quick)
#
# The live part has a ROS master of its own on a free port; one that is running already is left alone.
set -eo pipefail  # no -u: ROS's setup files read variables that are not set

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
package=urban_gnss_localization
seconds_a_lap=10  # of simulated time, a little more than the robot needs

usage() { sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; }

wrong_usage() {
  echo "demo.sh: $1" >&2
  usage >&2
  exit 2
}

quick=false
seeds=
rviz=false
output=
while [ $# -gt 0 ]; do
  case $1 in
    --quick) quick=true ;;
    --seeds) [[ $2 =~ ^[1-9][0-9]*$ ]] || wrong_usage "--seeds needs a number"; seeds=$2; shift ;;
    --rviz) rviz=true ;;
    --output) [ -n "$2" ] || wrong_usage "--output needs a folder"; output=$2; shift ;;
    -h | --help) usage; exit 0 ;;
    *) wrong_usage "$1 is not an option" ;;
  esac
  shift
done
live_laps=3
if $quick; then live_laps=1; fi
if [ -z "$output" ]; then
  output=$root/results/demo
  if $quick; then output+=_quick; fi
fi
if [ -z "$seeds" ]; then
  if $quick; then seeds=4; else seeds=30; fi
fi
if $rviz && [ -z "$DISPLAY" ]; then
  echo "== DISPLAY is not set: the live part runs without rviz"
  rviz=false
fi

bash "$root/scripts/setup.sh" --no-tests
. "$root/scripts/environment.sh"
mkdir -p "$output"
output=$(cd "$output" && pwd)
programs=$root/.workspace/devel/lib/$package

port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("", 0)); print(s.getsockname()[1])')
scratch=$(mktemp -d)
export ROS_MASTER_URI=http://localhost:$port ROS_HOME=$scratch
unset ROS_LOG_DIR

# Whatever was started below, also what roslaunch has put into process groups of their own: all know the master.
# What looks for them must not know it, neither grep nor cut.
our_processes() (
  export -n ROS_MASTER_URI
  grep -lszxF "ROS_MASTER_URI=$ROS_MASTER_URI" /proc/[0-9]*/environ | cut -d / -f 3 || true
)

signal_until_gone() {
  local signal=$1 tries=$2 processes
  shift 2
  kill -s "$signal" -- "$@" 2> /dev/null || true
  while ((tries-- > 0)); do
    processes=$(our_processes)
    if [ -z "$processes" ]; then return; fi
    sleep 0.2
  done
  return 1
}

job=    # what is waited for; its process group has its number
timer=  # of the live part
clean_up() {
  trap '' INT TERM HUP
  if [ -n "$timer" ]; then kill -s TERM -- "-$timer" 2> /dev/null || true; fi
  # roslaunch ends its nodes by itself, which takes it a few seconds, and rosbag closes its bag.
  if [ -n "$job" ]; then signal_until_gone INT 100 "-$job" || true; fi
  signal_until_gone TERM 15 $(our_processes) || signal_until_gone KILL 15 $(our_processes) || true
  rm -rf "$scratch"
}
trap clean_up EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
trap 'exit 129' HUP
set -m  # a job is a process group, and a signal interrupts waiting for it

run() {
  local status=0
  "$@" &
  job=$!
  wait $job || status=$?
  job=
  return $status
}

echo "== city: downtown_grid"
{
  run "$programs/simulate" --scenario downtown_grid --without-lidar --output "$scratch/city.bag"
  for localizer in imm_ekf ekf; do
    run "$programs/replay" "$scratch/city.bag" --localizer $localizer --output "$scratch/$localizer.bag"
  done
} > "$output/city.log" 2>&1 || { tail -n 40 "$output/city.log" >&2; exit 1; }
run "$programs/evaluate" "$scratch/imm_ekf.bag" "$scratch/ekf.bag" --truth "$scratch/city.bag" --output "$output/city" \
  > "$scratch/city.txt"

# Ends when the simulated time has come, or fails when the simulation does not go on.
drive() {
  python3 - "$1" << 'END'
import sys
import time
import rosgraph
import rospy

end = float(sys.argv[1])
patience = 60.0
last_progress, reported, seconds = time.time(), 0.0, 0.0
while not rosgraph.is_master_online():
    if time.time() > last_progress + patience:
        sys.exit("no ROS master after %.0f s" % patience)
    time.sleep(0.2)
rospy.set_param("/use_sim_time", True)  # which the launch file sets a moment later
rospy.init_node("demo_timer", anonymous=True, disable_signals=True)
while seconds < end:
    time.sleep(0.2)
    if rospy.get_time() > seconds:
        seconds, last_progress = rospy.get_time(), time.time()
    elif time.time() > last_progress + patience:
        sys.exit("the simulated time stands at %.1f s" % seconds)
    if seconds >= reported + 10.0:
        reported = seconds
        print("   %.0f of %.0f s" % (seconds, end), flush=True)
END
}

live_seconds=$((live_laps * seconds_a_lap))
echo "== live: $live_seconds s of simulated time"
roslaunch -p "$port" $package demo.launch rviz:=$rviz compare:=true record:="$scratch/live.bag" \
  > "$output/live.log" 2>&1 &
job=$!
drive $live_seconds &
timer=$!
status=0
wait -n $job $timer || status=$?
if ! kill -0 $job 2> /dev/null || [ $status -ne 0 ]; then
  echo "demo.sh: the live part failed; the last lines of $output/live.log:" >&2
  tail -n 40 "$output/live.log" >&2
  exit 1
fi
signal_until_gone INT 150 "-$job" || { echo "demo.sh: the nodes did not end" >&2; exit 1; }
job=
mv "$scratch/live.bag" "$output/live.bag"
run "$programs/evaluate" "$output/live.bag" --estimate-topic odometry/filtered \
  --estimate-topic conventional/odometry/filtered --output "$output/live"

echo "== experiment: $seeds seeds"
run "$programs/paper_experiment" --seeds "$seeds" --laps 3 --noise-scale 1e-6 --bias-direction random \
  --methods paper,paper_ring_1,switching,imm_ekf,conventional,literal,dead_reckoning,oracle_zone,oracle \
  --plots "$output" --json "$output/metrics.json"

echo "== the drive through the city: imm_ekf, ekf (a plain EKF), and the raw fix of each"
grep -v '^report\|/report.html$' "$scratch/city.txt"
echo "== done in $SECONDS s
all         $output/report.html
city        $output/city/report.html
live drive  $output/live/report.html
in rviz     . scripts/environment.sh && roslaunch $package demo.launch"
