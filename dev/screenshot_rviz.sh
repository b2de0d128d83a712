#!/bin/bash
# Takes a picture of rviz as a launch file of this package shows it. Needs no display and no running master.
#
#   screenshot_rviz.sh FILE.png TOPIC CONDITION LAUNCH_FILE [ARG:=VALUE]...
#
# The picture is taken as soon as a message m on TOPIC meets CONDITION (Python, as in rostopic echo --filter). The
# workspace's setup.bash must have been sourced. Needs `apt-get install xvfb xauth imagemagick`. The pictures in docs/:
#
#   screenshot_rviz.sh docs/images/rviz_demo.png /ground_truth/odom \
#     'm.header.stamp.to_sec() > 8 and m.pose.pose.position.x < -13' demo.launch real_time_factor:=0.2
#   screenshot_rviz.sh docs/images/rviz_replay.png /odometry/filtered 'm.header.stamp.to_sec() > 95806' \
#     replay.launch rate:=6 bag:=/path/to/hk_tst_20210517_ublox.bag
#   screenshot_rviz.sh docs/images/rviz_city.png /ground_truth/odom 'm.header.stamp.to_sec() > 1777863655' \
#     demo.launch scenario:=downtown_grid real_time_factor:=0.5
#   screenshot_rviz.sh docs/images/rviz_occlusion.png /ground_truth/odom 'm.header.stamp.to_sec() > 1777863632' \
#     demo.launch scenario:=downtown_grid occlusion:=true real_time_factor:=0.4
#   screenshot_rviz.sh docs/images/rviz_comparison.png /ground_truth/odom 'm.header.stamp.to_sec() > 1777863660' \
#     comparison.launch real_time_factor:=0.4
#
# Without a graphics card rviz draws a few frames a second: a slow simulation or bag keeps its displays in step.
set -eo pipefail

if [ $# -lt 4 ]; then
  sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0" >&2
  exit 2
fi
if [ -z "$SCREENSHOT_DISPLAY" ]; then
  SCREENSHOT_DISPLAY=1 LIBGL_ALWAYS_SOFTWARE=1 exec xvfb-run -a -s "-screen 0 1280x800x24 +extension GLX" "$0" "$@"
fi
file=$1 topic=$2 condition=$3 launch_file=$4
shift 4

port=$(python3 -c 'import socket; s = socket.socket(); s.bind(("", 0)); print(s.getsockname()[1])')
export ROS_MASTER_URI=http://localhost:$port ROS_HOSTNAME=localhost
set -m  # a background job of its own, which can be interrupted
roslaunch -p "$port" urban_gnss_localization "$launch_file" "$@" &
launch=$!
trap 'kill -INT $launch 2>/dev/null; wait $launch || true' EXIT

until rosnode list 2>/dev/null | grep -q '^/rviz'; do
  kill -0 $launch 2>/dev/null || { echo "$launch_file ended before rviz was there" >&2; exit 1; }
  sleep 0.5
done
timeout "${SCREENSHOT_TIMEOUT:-300}" rostopic echo -n 1 --filter "$condition" "$topic" > /dev/null ||
  { echo "no message on $topic with: $condition" >&2; exit 1; }
rosnode ping -c 1 /rviz > /dev/null || { echo "rviz has died" >&2; exit 1; }
import -window root -strip -define png:compression-level=9 "$file"
echo "$file: $(stat -c %s "$file") bytes"
