#!/usr/bin/env bash
# Builds the rooms' tests with the compiler's sanitizers into .workspace/sanitize and runs them. Stops at the first
# program that finds something.
#
#   dev/sanitize.sh [address|thread] [ROOM…]      for example address gnss receivers; default: address, every room
#
# address: AddressSanitizer, leaks, UndefinedBehaviorSanitizer, the assertions of Eigen and of the standard library.
# thread:  ThreadSanitizer. The libraries of ROS and PCL are not instrumented; dev/sanitize_thread.txt says what of them
#          is left out, and why.
set -eo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
kind=${1:-address}
rooms=("${@:2}")
case $kind in
  address) flags="-fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all" ;;
  thread) flags="-fsanitize=thread" ;;
  -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; exit 0 ;;
  *) echo "sanitize.sh: $kind is neither address nor thread" >&2; exit 2 ;;
esac
build=$root/.workspace/sanitize/$kind

. "$root/scripts/environment.sh"
# A build type of its own, so that no assertion is compiled out.
cmake -S "$root" -B "$build" -DCATKIN_DEVEL_PREFIX="$build/devel" -DCATKIN_ENABLE_TESTING=ON \
  -DCMAKE_BUILD_TYPE=Sanitize -DCMAKE_CXX_FLAGS="-O1 -g1 -fno-omit-frame-pointer $flags -D_GLIBCXX_ASSERTIONS" \
  > "$build.log"
if [ ${#rooms[@]} -eq 0 ]; then
  mapfile -t rooms < <(ctest --test-dir "$build" --show-only | sed -n 's/.* build_\(.*\)_tests$/\1/p')
fi
cmake --build "$build" --parallel "$(nproc)" --target "${rooms[@]/%/_tests}" >> "$build.log"

export ASAN_OPTIONS=strict_string_checks=1:detect_stack_use_after_return=1:check_initialization_order=1
export UBSAN_OPTIONS=print_stacktrace=1
export TSAN_OPTIONS=suppressions=$root/dev/sanitize_thread.txt:second_deadlock_stack=1
for room in "${rooms[@]}"; do
  echo "== $room"
  program=$(find "$build" -name "${room}_tests" -type f -perm -u+x)
  "$program" --gtest_brief=1
done
