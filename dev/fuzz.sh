#!/usr/bin/env bash
# Fuzzes the readers of what comes from outside (test/fuzz) with libFuzzer, AddressSanitizer and
# UndefinedBehaviorSanitizer, one after the other, in .workspace/fuzz.
#
#   dev/fuzz.sh [--seconds N] [--merge] [TARGET…]     for example dev/fuzz.sh --seconds 600 scenario pcd
#
#   --seconds N  for each target, 60 by default
#   --merge      afterwards put what reaches more of the code into test/fuzz/corpus; look at it before you commit it
#
# Needs Clang with its runtime: apt-get install clang-14 libclang-rt-14-dev. Prints a table: inputs, the processor's
# seconds, edges of the code that were reached, files of the corpus, findings. A finding is an input in
# .workspace/fuzz/findings/TARGET, and ends that target; its kind is repaired, and it goes into test/fuzz/corpus.
set -eo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/.workspace/fuzz
seconds=60
merge=false
targets=()
while [ $# -gt 0 ]; do
  case $1 in
    --seconds) seconds=$2; shift ;;
    --merge) merge=true ;;
    -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; exit 0 ;;
    *) targets+=("$1") ;;
  esac
  shift
done
known=($(ls "$root/test/fuzz/corpus"))
if [ ${#targets[@]} -eq 0 ]; then targets=("${known[@]}"); fi
for target in "${targets[@]}"; do
  if [[ " ${known[*]} " != *" $target "* ]]; then
    echo "fuzz.sh: no target $target; there are ${known[*]}" >&2
    exit 2
  fi
done

. "$root/scripts/environment.sh"
mkdir -p "$build"
flags="-fsanitize=fuzzer-no-link,address,undefined,float-cast-overflow -fno-sanitize-recover=all"
cmake -S "$root" -B "$build" -DCATKIN_DEVEL_PREFIX="$build/devel" -DCATKIN_ENABLE_TESTING=ON \
  -DCMAKE_CXX_COMPILER=clang++-14 -DCMAKE_BUILD_TYPE=Sanitize \
  -DCMAKE_CXX_FLAGS="-O1 -g1 -fno-omit-frame-pointer $flags -D_GLIBCXX_ASSERTIONS" > "$build.log"
cmake --build "$build" --parallel "$(nproc)" --target fuzz >> "$build.log"
# Its own libraries, not the plain ones that environment.sh names.
export LD_LIBRARY_PATH="$build/devel/lib:$LD_LIBRARY_PATH"
fuzz=$build/devel/lib/urban_gnss_localization/fuzz
if [ ! -x "$fuzz" ]; then fuzz=$build/fuzz; fi

# Runs the target; its line of the table. A finding ends it.
run_target() {
  local target=$1 log=$build/$1.log corpus=$build/corpus/$1 findings=$build/findings/$1 processor
  mkdir -p "$corpus" "$findings"
  processor=$({ TIMEFORMAT='%3U %3S'; time "$fuzz" --target="$target" "$corpus" "$root/test/fuzz/corpus/$target" \
    -max_total_time="$seconds" -timeout=60 -report_slow_units=60 -rss_limit_mb=2048 -max_len=20000 \
    -use_value_profile=1 -artifact_prefix="$findings/" -print_final_stats=1 > "$log" 2>&1 || true; } 2>&1 |
    awk '{ print $1 + $2 }')
  if $merge; then
    "$fuzz" --target="$target" -merge=1 -max_len=4000 "$root/test/fuzz/corpus/$target" "$corpus" >> "$log" 2>&1
  fi
  echo "| $target | $(sed -n 's/^stat::number_of_executed_units: *//p' "$log") | $processor |" \
    "$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$log" | tail -n 1) | $(ls "$root/test/fuzz/corpus/$target" | wc -l) |" \
    "$(ls "$findings" | wc -l) |"
}

echo "| target | inputs | processor, s | edges | corpus | findings |"
echo "|---|---|---|---|---|---|"
for target in "${targets[@]}"; do run_target "$target"; done
if compgen -G "$build/findings/*/*" > /dev/null; then
  echo "fuzz.sh: findings in $build/findings" >&2
  exit 1
fi
