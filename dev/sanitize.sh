#!/usr/bin/env bash
# Builds the rooms' tests, and all that they link, with AddressSanitizer (leaks too), UndefinedBehaviorSanitizer and the
# assertions of Eigen and of the standard library, in .workspace/sanitize, and runs them. Stops at the first finding.
#
#   dev/sanitize.sh [ROOM…]     for example dev/sanitize.sh gnss receivers; every room by default
set -eo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/.workspace/sanitize
case $1 in
  -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; exit 0 ;;
esac
rooms=("$@")

. "$root/scripts/environment.sh"
mkdir -p "$build"
flags="-fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all -D_GLIBCXX_ASSERTIONS"
# A build type of its own, so that no assertion is compiled out.
cmake -S "$root" -B "$build" -DCATKIN_DEVEL_PREFIX="$build/devel" -DCATKIN_ENABLE_TESTING=ON \
  -DCMAKE_BUILD_TYPE=Sanitize -DCMAKE_CXX_FLAGS="-O1 -g1 -fno-omit-frame-pointer $flags" > "$build.log"
if [ ${#rooms[@]} -eq 0 ]; then
  mapfile -t rooms < <(ctest --test-dir "$build" --show-only | sed -n 's/.* build_\(.*\)_tests$/\1/p')
fi
cmake --build "$build" --parallel "$(nproc)" --target "${rooms[@]/%/_tests}" >> "$build.log"

export ASAN_OPTIONS=strict_string_checks=1:detect_stack_use_after_return=1:check_initialization_order=1
export UBSAN_OPTIONS=print_stacktrace=1
export LD_LIBRARY_PATH=$build/devel/lib:$LD_LIBRARY_PATH  # before the libraries of the usual build
for room in "${rooms[@]}"; do
  echo "== $room"
  "$build/devel/lib/urban_gnss_localization/${room}_tests" --gtest_brief=1
done
