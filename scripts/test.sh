#!/usr/bin/env bash
# Builds the package with scripts/setup.sh and runs all tests, two at a time. The exit status is ctest's.
#
#   scripts/test.sh [OPTIONS OF CTEST]       for example -R core
#
# Tests on real recordings want the folder URBAN_GNSS_DATA (default ../shared/data beside this clone) and are skipped where
# it is missing.
set -eo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
workspace=$root/.workspace
case $1 in
  -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; exit 0 ;;
esac

bash "$root/scripts/setup.sh"
. "$root/scripts/environment.sh"
export ROS_HOME=$workspace/ros
unset ROS_LOG_DIR

export URBAN_GNSS_DATA=${URBAN_GNSS_DATA:-$root/../shared/data}
if [ -d "$URBAN_GNSS_DATA" ]; then
  echo "== recordings: $(cd "$URBAN_GNSS_DATA" && pwd)"
else
  echo "== recordings: SKIPPED are the tests on real recordings, for there is no folder $URBAN_GNSS_DATA (URBAN_GNSS_DATA)"
  unset URBAN_GNSS_DATA
fi

mkdir -p "$workspace/tests"
echo 'subdirs("../build")' > "$workspace/tests/CTestTestfile.cmake"
cd "$workspace/tests"
echo "== tests"
exec ctest --output-on-failure --timeout 600 -j2 "$@"
