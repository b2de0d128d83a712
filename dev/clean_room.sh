#!/usr/bin/env bash
# Runs the README's two commands, scripts/demo.sh and scripts/test.sh, as on a new machine: in an empty Debian 12, from
# a clean clone of the commit that is checked out. What setup.sh does not install is not there, and so it shows.
#
#   dev/clean_room.sh [--quick] [--demo-only | --test-only] [--keep] [--tree DIR]
#
#   --quick      demo.sh --quick
#   --demo-only  leave out test.sh
#   --test-only  leave out demo.sh
#   --keep       keep the tree that was run in, and say where it is
#   --tree DIR   keep the empty Debian in DIR/base.tar, and take it from there next time; what is run in is always a new
#                copy, in DIR/room.* (default: a folder of its own in TMPDIR or /var/tmp, deleted at the end)
#
# Needs root, `apt-get install debootstrap git`, and 8 GB of disk; a full run takes about an hour of two processors.
# Recordings (URBAN_GNSS_DATA, or ../shared/data beside the clone) are there to be read, where they exist.
#
# What is relied on: the sources, proxies, keys and certificates of this machine's apt, which are copied into the tree.
# Network: setup.sh calls apt inside, so the commands can reach what this machine can reach; nothing else of the package
# downloads anything, and nothing here makes sure of that. Mounts, processes, shared memory and the host's name are the
# tree's own and end with the run, however it ends.
set -eo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
suite=bookworm
home=/clean_room  # in the tree: the clone, and beside it shared/data
clone=$home/urban_gnss_localization

usage() { sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; }

wrong_usage() {
  echo "clean_room.sh: $1" >&2
  usage >&2
  exit 2
}

stop() {
  echo "clean_room.sh: $1" >&2
  exit 1
}

quick=
demo=true
test=true
keep=false
folder=
while [ $# -gt 0 ]; do
  case $1 in
    --quick) quick=" --quick" ;;
    --demo-only) test=false ;;
    --test-only) demo=false ;;
    --keep) keep=true ;;
    --tree) [ -n "$2" ] || wrong_usage "--tree needs a folder"; folder=$2; shift ;;
    -h | --help) usage; exit 0 ;;
    *) wrong_usage "$1 is not an option" ;;
  esac
  shift
done
$demo || $test || wrong_usage "--demo-only and --test-only leave nothing to run"
[ "$(id -u)" -eq 0 ] || stop "only root can make and enter the tree"
PATH=$PATH:/usr/sbin:/sbin
for program in debootstrap git; do
  command -v $program > /dev/null || stop "there is no $program: apt-get install $program"
done
unshare --mount --pid --ipc --uts --fork true || stop "this machine allows no namespaces of our own (see unshare above)"

temporary=  # what nobody asked to keep
room=
child=
clean_up() {
  local status=$?
  trap '' INT TERM HUP
  # With its first process the namespaces end, and with them every process and mount in them.
  if [ -n "$child" ]; then kill -s KILL $child 2> /dev/null || true; wait $child 2> /dev/null || true; fi
  if [ -n "$room" ] && $keep; then
    echo "== kept: $room"
  else
    rm -rf --one-file-system ${room:+"$room"} ${temporary:+"$temporary"}
  fi
  exit $status
}
trap clean_up EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
trap 'exit 129' HUP

# Calls a command with mounts and processes of its own, and waits for it where a signal can interrupt.
isolated() {
  local status=0
  unshare --mount --pid --ipc --uts --fork --kill-child --mount-proc "$@" < /dev/null &
  child=$!
  wait $child || status=$?
  child=
  return $status
}

# Where this machine's apt takes Debian from.
mirror() {
  apt-get indextargets --format '$(REPO_URI) $(CODENAME) $(COMPONENT)' 'Identifier: Packages' |
    awk -v suite=$suite '$2 == suite && $3 == "main" && !found {print $1; found = 1}'
}

# debootstrap has no configuration of its own for proxies; apt's counts where the environment has none.
export_proxies() {
  local http= https=
  eval "$(apt-config shell http Acquire::http::Proxy https Acquire::https::Proxy)"
  if [ -n "$http" ] && [ "$http" != DIRECT ]; then export http_proxy=${http_proxy:-$http}; fi
  if [ -n "$https" ] && [ "$https" != DIRECT ]; then export https_proxy=${https_proxy:-$https}; fi
}

make_base() {
  local from tree=$folder/base.part
  from=$(mirror)
  if [ -z "$from" ]; then
    echo "== apt-get update, for this machine's apt does not say yet where it has $suite from"
    apt-get -q update
    from=$(mirror)
  fi
  [ -n "$from" ] || stop "this machine's apt has no source of Debian's $suite"
  echo "== debootstrap: an empty $suite"
  export_proxies
  rm -rf --one-file-system "$tree"
  if ! isolated debootstrap --variant=minbase $suite "$tree" "$from" > "$folder/debootstrap.log" 2>&1; then
    tail -n 20 "$folder/debootstrap.log" "$tree/debootstrap/debootstrap.log" >&2 || true
    stop "debootstrap failed; its output is above"
  fi
  tar -C "$tree" --numeric-owner -cf "$folder/base.tar.part" .
  mv "$folder/base.tar.part" "$folder/base.tar"
  rm -rf --one-file-system "$tree"
}

# Copies a file of this machine to the same place in the tree, if it is there.
copy_in() {
  local path
  for path in "$@"; do
    if [ -e "$path" ]; then
      mkdir -p "$room${path%/*}"
      cp -RLT "$path" "$room$path"
    fi
  done
}

# The network and apt of this machine.
configure_tree() {
  local ca=
  rm -rf "$room/etc/apt"
  copy_in /etc/apt /etc/resolv.conf /etc/hosts /etc/ssl/certs/ca-certificates.crt /usr/local/share/ca-certificates
  eval "$(apt-config shell ca Acquire::https::CaInfo)"
  if [ -n "$ca" ]; then copy_in "$ca"; fi
  mkdir -p "$room/usr/share/keyrings"
  cp -Ln /usr/share/keyrings/*.gpg "$room/usr/share/keyrings/" || true
  printf '\n127.0.0.1 localhost clean-room\n' >> "$room/etc/hosts"
  echo clean-room > "$room/etc/hostname"
  printf '#!/bin/sh\nexit 101\n' > "$room/usr/sbin/policy-rc.d"  # no package starts a service
  chmod 755 "$room/usr/sbin/policy-rc.d"
}

copy_clone() {
  local commit
  commit=$(git -C "$root" rev-parse HEAD)
  echo "== clone: $(git -C "$root" log -1 --format='%h %s' HEAD)"
  if [ -n "$(git -C "$root" status --porcelain)" ]; then echo "   what is not committed is left out"; fi
  mkdir -p "$room$home"
  git clone --quiet --no-hardlinks --no-checkout "file://$root" "$room$clone"
  git -C "$room$clone" checkout --quiet --detach "$commit"
}

# Runs in namespaces of its own: mounts what a system has and calls one command in the clone.
enter() {
  local room=$1 data=$2 home=$3 clone=$4 command=$5 device variable
  mount --make-rprivate /
  mount --bind "$room" "$room"  # so that a kept tree shows nothing of this machine
  mount -t proc proc "$room/proc"
  mount --rbind /sys "$room/sys"
  mount -t tmpfs -o mode=755 tmpfs "$room/dev"
  for device in null zero full random urandom tty; do
    : > "$room/dev/$device"
    mount --bind "/dev/$device" "$room/dev/$device"
  done
  mkdir "$room/dev/pts" "$room/dev/shm"
  mount -t devpts -o newinstance,ptmxmode=0666 devpts "$room/dev/pts"
  mount -t tmpfs -o mode=1777 tmpfs "$room/dev/shm"
  ln -s pts/ptmx "$room/dev/ptmx"
  ln -s /proc/self/fd "$room/dev/fd"
  ln -s fd/0 "$room/dev/stdin"
  ln -s fd/1 "$room/dev/stdout"
  ln -s fd/2 "$room/dev/stderr"
  if [ -n "$data" ]; then
    mkdir -p "$room$home/shared/data"
    mount --bind "$data" "$room$home/shared/data"
    mount -o remount,bind,ro "$room$home/shared/data"
  fi
  hostname clean-room
  # Signals as on a terminal: one that is ignored here could not be trapped inside.
  set -- env -i --default-signal=INT,QUIT,HUP,TERM HOME=/root LANG=C.UTF-8 TERM=dumb \
    PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
  for variable in http_proxy https_proxy ftp_proxy no_proxy HTTP_PROXY HTTPS_PROXY NO_PROXY; do
    if [ -n "${!variable}" ]; then set -- "$@" "$variable=${!variable}"; fi
  done
  # Not exec: the namespace's first process is to outlive what the command leaves behind.
  chroot "$room" "$@" bash -c "cd $clone && $command"
}

results=
failed=false
run() {
  local command=$1 name status=0
  name=$(basename "${command%% *}")
  echo "== $command"
  isolated bash -c "set -eo pipefail; $(declare -f enter); enter \"\$@\"" enter \
    "$room" "$data" $home $clone "$command" || status=$?
  if [ $status -eq 0 ]; then
    results+="$name ok, "
  else
    results+="$name FAILED with status $status, "
    failed=true
  fi
}

if [ -n "$folder" ]; then
  mkdir -p "$folder"
else
  folder=$(mktemp -d "${TMPDIR:-/var/tmp}/clean_room.XXXXXX")
  temporary=$folder
fi
folder=$(cd "$folder" && pwd -P)
data=${URBAN_GNSS_DATA:-$root/../shared/data}
if [ -d "$data" ]; then
  data=$(cd "$data" && pwd -P)
  echo "== recordings: $data"
else
  data=
  echo "== recordings: none, so that test.sh skips the tests on them"
fi
if [ -f "$folder/base.tar" ]; then
  echo "== the empty $suite of $folder/base.tar"
else
  make_base
fi
room=$(mktemp -d "$folder/room.XXXXXX")
chmod 755 "$room"
tar -C "$room" --numeric-owner -xpf "$folder/base.tar"
configure_tree
copy_clone
if $demo; then run "scripts/demo.sh$quick"; fi
if $test; then run scripts/test.sh; fi
echo "clean room: ${results%, } ($SECONDS s)"
if $failed; then exit 1; fi
