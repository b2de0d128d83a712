#!/usr/bin/env bash
# Builds the rooms' tests, and all that they link, with AddressSanitizer (leaks too), UndefinedBehaviorSanitizer and the
# assertions of Eigen and of the standard library, in .workspace/sanitize, and runs them. Stops at the first finding.
#
#   dev/sanitize.sh [ROOM…]     for example dev/sanitize.sh gnss receivers; every room by default
#   dev/sanitize.sh --nodes [OPTIONS OF dev/fault_campaign.py]
#   dev/sanitize.sh --thread [OPTIONS OF dev/fault_campaign.py]     for example --seconds 600 --rigs imm_ekf occlusion
#
#   --nodes   the live nodes and the nodelet with the same sanitizers, under odd messages, services from ten threads,
#             clocks that jump; --seconds 300 by default. Reports are .workspace/sanitize/reports/*
#   --thread  the same with ThreadSanitizer, in .workspace/sanitize_thread, without what dev/thread_sanitizer.supp names
set -eo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/.workspace/sanitize
# Not nonnull-attribute: of a message without a byte, ROS's ShapeShifter copies 0 bytes to nowhere.
flags="-fsanitize=address,undefined,float-cast-overflow -fno-sanitize=nonnull-attribute -fno-sanitize-recover=all"
flags+=" -D_GLIBCXX_ASSERTIONS"
runtime=libasan.so
nodes=false
case $1 in
  -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; exit 0 ;;
  --nodes) nodes=true; shift ;;
  --thread) nodes=true; shift; build=$root/.workspace/sanitize_thread; flags=-fsanitize=thread; runtime=libtsan.so ;;
  -*) echo "sanitize.sh: $1 is not an option" >&2; exit 2 ;;
esac
rooms=($(cd "$root/test" && ls -d */test_*.cpp | sed 's|/.*||' | uniq))
for room in "$@"; do
  if ! $nodes && [[ " ${rooms[*]} " != *" $room "* ]]; then
    echo "sanitize.sh: no room $room; there are ${rooms[*]}" >&2
    exit 2
  fi
done

. "$root/scripts/environment.sh"
mkdir -p "$build"
# A build type of its own, so that no assertion is compiled out.
cmake -S "$root" -B "$build" -DCATKIN_DEVEL_PREFIX="$build/devel" -DCATKIN_ENABLE_TESTING=ON \
  -DCMAKE_BUILD_TYPE=Sanitize -DCMAKE_CXX_FLAGS="-O1 -g1 -fno-omit-frame-pointer $flags" > "$build.log" 2>&1
make_targets() {
  if ! cmake --build "$build" --parallel "$(nproc)" --target "$@" >> "$build.log" 2>&1; then
    tail -n 20 "$build.log" >&2
    exit 1
  fi
}
export ASAN_OPTIONS=strict_string_checks=1:detect_stack_use_after_return=1:check_initialization_order=1
export UBSAN_OPTIONS=print_stacktrace=1

run_rooms() {
  local room
  if [ $# -gt 0 ]; then rooms=("$@"); fi
  make_targets "${rooms[@]/%/_tests}"
  export LD_LIBRARY_PATH=$build/devel/lib:$LD_LIBRARY_PATH  # before the libraries of the usual build
  for room in "${rooms[@]}"; do
    echo "== $room"
    "$build/devel/lib/urban_gnss_localization/${room}_tests" --gtest_brief=1
  done
}

run_nodes() {
  local reports=$build/reports targets status=0
  mapfile -t targets < <(cmake --build "$build" --target help | sed -n 's/^\.\.\. \(.*_node\|.*_nodelets\)$/\1/p')
  make_targets "${targets[@]}"
  rm -rf "$reports"
  mkdir -p "$reports" "$build/bin"
  # ROS's own program of nodelets is built without sanitizers, which must come before all other libraries.
  local preload="env LD_PRELOAD=$("${CXX:-g++}" -print-file-name=$runtime)"
  printf '#!/bin/sh\nexec %s --prefix "%s" "$@"\n' "$(command -v rosrun)" "$preload" > "$build/bin/rosrun"
  chmod +x "$build/bin/rosrun"
  . "$build/devel/setup.bash"
  ASAN_OPTIONS+=:detect_leaks=0:log_path=$reports/asan
  UBSAN_OPTIONS+=:log_path=$reports/ubsan
  # What ROS's libraries do with memory is not seen; that they lock is.
  export TSAN_OPTIONS="suppressions='$root/dev/thread_sanitizer.supp' log_path='$reports/tsan'
    ignore_noninstrumented_modules=1 second_deadlock_stack=1 exitcode=0"
  PATH=$build/bin:$PATH URBAN_GNSS_PROGRAMS=$build/devel/lib/urban_gnss_localization \
    "$root/dev/fault_campaign.py" --seconds 300 "$@" || status=$?
  if compgen -G "$reports/*" > /dev/null; then
    cat "$reports"/* | grep -E "^(SUMMARY|.*runtime error)" | sort | uniq -c
    echo "sanitize.sh: findings in $reports" >&2
    status=1
  fi
  return $status
}

if $nodes; then run_nodes "$@"; else run_rooms "$@"; fi
