#!/usr/bin/env bash
# Installs what is missing and builds the package into .workspace of this clone. Run it again after every change.
#
#   scripts/setup.sh [--no-tests] [--no-install] [--jobs N]
#
#   --no-tests    leave out the tests' programs
#   --no-install  leave the system's packages alone
#   --jobs N      compile N files at once (default: a processor and 1.5 GB of memory for each)
#
# Debian 12 gets the packages in the first column of scripts/apt-debian.txt, Ubuntu 20.04 with /opt/ros/noetic those in the
# second; apt-get runs through sudo unless you are root. The build's output is in .workspace/build.log.
set -eo pipefail  # no -u: ROS's setup files read variables that are not set

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
workspace=$root/.workspace
build=$workspace/build
devel=$workspace/devel
log=$workspace/build.log

usage() { sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; }

wrong_usage() {
  echo "setup.sh: $1" >&2
  usage >&2
  exit 2
}

report_progress() {
  local second=0
  while kill -0 $$ 2> /dev/null; do  # short sleeps, for the last one outlives this
    sleep 1 > /dev/null 2>&1
    if ((++second % 15 == 0)); then echo "   $second s: $(tail -n 1 "$log" | cut -c 1-100)"; fi
  done
}

ticker=
stop_ticker() {
  if [ -n "$ticker" ]; then kill $ticker 2> /dev/null || true; wait $ticker 2> /dev/null || true; fi
  ticker=
}
trap stop_ticker EXIT

# Calls a command with its output in the log; says now and then how far it is, and shows the log's end if it fails.
logged() {
  local label=$1 status=0
  shift
  echo "-- $label: $*" >> "$log"
  report_progress &
  ticker=$!
  "$@" >> "$log" 2>&1 || status=$?
  stop_ticker
  if [ $status -ne 0 ]; then
    echo "== $label failed; the last lines of $log:" >&2
    tail -n 60 "$log" >&2
    return $status
  fi
}

packages_wanted() {
  local column=1
  if [ -d /opt/ros/noetic ]; then column=2; fi
  sed 's/#.*//' "$root/scripts/apt-debian.txt" | awk -v column=$column 'NF && !seen[$column]++ {print $column}'
}

packages_missing() {
  local installed
  installed=$(dpkg-query -W -f '${Package} ${db:Status-Abbrev}\n' 2> /dev/null | awk '$2 == "ii" || $2 == "hi" {print $1}')
  packages_wanted | grep -vxF -e "$installed" || true
}

apt() {
  local as_root=()
  if [ "$(id -u)" -ne 0 ]; then as_root=(sudo); fi
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=600 -o Acquire::Retries=3 "$@"
}

install_packages() {
  local missing try
  missing=$(packages_missing)
  if [ -z "$missing" ]; then return; fi
  echo "== packages: $(echo $missing)"
  if [ "$(id -u)" -ne 0 ] && ! command -v sudo > /dev/null; then
    echo "setup.sh: neither root nor sudo: have these packages installed, or use --no-install" >&2
    return 1
  fi
  if [ "$(id -u)" -ne 0 ]; then sudo -v; fi  # asks here, not behind the log
  # Another apt-get may hold the lock of the lists, for which there is no waiting option.
  for try in 1 2 3 4 5 6; do
    if apt update >> "$log" 2>&1; then break; fi
    sleep 5
  done
  logged packages apt install -y --no-install-recommends $missing
  rm -f "$build/configured"  # CMake shall look for them
}

# As many compilers as there are processors, with 1.5 GB of memory for each.
job_count() {
  local processors bytes jobs
  processors=$(nproc)
  for bytes in $(awk '$1 == "MemAvailable:" {printf "%.0f", 1024 * $2}' /proc/meminfo 2> /dev/null) \
    $(cat /sys/fs/cgroup/memory.max /sys/fs/cgroup/memory/memory.limit_in_bytes 2> /dev/null); do
    if [[ $bytes =~ ^[0-9]{1,15}$ ]]; then
      jobs=$((bytes / 1500000000))
      if ((jobs < processors)); then processors=$jobs; fi
    fi
  done
  echo $((processors > 0 ? processors : 1))
}

# The build tree belongs to one place and one ROS: a clone that was moved or copied starts anew.
forget_other_build() {
  if [ -f "$build/configured" ] && [ "$(cat "$build/configured")" != "$configuration" ]; then rm -rf "$build" "$devel"; fi
}

# Once; after that make sees what has changed.
configure() {
  if [ -f "$build/configured" ]; then return; fi
  echo "== configure"
  logged configure cmake -S "$root" -B "$build" -DCATKIN_DEVEL_PREFIX="$devel" \
    -DCMAKE_INSTALL_PREFIX="$workspace/install" -DCATKIN_ENABLE_TESTING=ON
  echo "$configuration" > "$build/configured"
}

tests=true
install=true
jobs=
while [ $# -gt 0 ]; do
  case $1 in
    --no-tests) tests=false ;;
    --no-install) install=false ;;
    --jobs) [[ $2 =~ ^[1-9][0-9]*$ ]] || wrong_usage "--jobs needs a number"; jobs=$2; shift ;;
    -h | --help) usage; exit 0 ;;
    *) wrong_usage "$1 is not an option" ;;
  esac
  shift
done

mkdir -p "$workspace"
: > "$log"
configuration="$root with ROS of $(ls -d /opt/ros/noetic 2> /dev/null || echo /usr)"
forget_other_build
if $install && command -v apt-get > /dev/null; then install_packages; fi
. "$root/scripts/environment.sh"
# Which knows this tree, once it is built: what is installed must not name it. CMake may configure anew in any build.
CMAKE_PREFIX_PATH=$(tr ':' '\n' <<< "$CMAKE_PREFIX_PATH" | { grep -vFx "$devel" || true; } | paste -sd: -)
configure
targets=(all)
if $tests; then targets+=(tests); fi
echo "== build: ${targets[*]}"
logged build cmake --build "$build" --parallel "${jobs:-$(job_count)}" --target "${targets[@]}"
echo "== built: . scripts/environment.sh puts it into your shell"
