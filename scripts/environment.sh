# To be sourced by bash or zsh, from anywhere: ROS and, once scripts/setup.sh has built it, this package.
#
#   . scripts/environment.sh

if [ -z "$BASH_VERSION$ZSH_VERSION" ]; then
  echo "environment.sh: for bash or zsh, not for sh" >&2
  return 1
fi

_urban_gnss_root=$(cd "$(dirname "${BASH_SOURCE[0]:-${(%):-%x}}")/.." && pwd)
_urban_gnss_shell=${ZSH_VERSION:+zsh}
_urban_gnss_shell=${_urban_gnss_shell:-bash}

# ROS's Python modules belong to the system's python3; one of pyenv or conda does not find them.
_urban_gnss_path=":$PATH:"
_urban_gnss_path="${_urban_gnss_path//:\/usr\/bin:/:}"
_urban_gnss_path="${_urban_gnss_path//:\/bin:/:}"
_urban_gnss_path="${_urban_gnss_path#:}"
export PATH="/usr/bin:/bin:${_urban_gnss_path%:}"

if [ -f "/opt/ros/noetic/setup.$_urban_gnss_shell" ]; then
  . "/opt/ros/noetic/setup.$_urban_gnss_shell"
fi
if [ -f "$_urban_gnss_root/.workspace/devel/setup.$_urban_gnss_shell" ]; then
  . "$_urban_gnss_root/.workspace/devel/setup.$_urban_gnss_shell"
fi
if [ ! -d "$_urban_gnss_root/.workspace/devel" ] && [[ $- == *i* ]]; then
  echo "environment.sh: this package is not built yet: $_urban_gnss_root/scripts/setup.sh" >&2
fi
# Completion with the tab key, where somebody types. Debian's rosbash is no part of setup.bash.
if [ -n "$BASH_VERSION" ] && [[ $- == *i* ]]; then
  if ! type roscd > /dev/null 2>&1 && [ -f /usr/share/bash-completion/completions/rosbash ]; then
    . /usr/share/bash-completion/completions/rosbash
  fi
  # It does not look into hidden folders, where scripts/setup.sh builds.
  if type _roscomplete_exe > /dev/null 2>&1; then
    _urban_gnss_programs=$(find -L "$_urban_gnss_root/.workspace/devel/lib/urban_gnss_localization" \
      "$_urban_gnss_root/reports" "$_urban_gnss_root/doctor" -maxdepth 1 -type f -perm /111 \
      ! -name '*_tests' ! -name 'test_*' 2> /dev/null | sed 's/.*\///') || true
    _urban_gnss_complete() {
      _roscomplete_exe
      if [ "$COMP_CWORD" -eq 2 ] && [ "${COMP_WORDS[1]}" = urban_gnss_localization ]; then
        COMPREPLY=($(compgen -W "$_urban_gnss_programs" -- "${COMP_WORDS[2]}"))
      fi
    }
    complete -F _urban_gnss_complete rosrun
  fi
fi
# Several nodes share the console of a launch file: each line says whose it is.
if [ -z "$ROSCONSOLE_FORMAT" ]; then
  export ROSCONSOLE_FORMAT='[${severity}] [${time}] [${node}]: ${message}'
fi
if [ -z "$ROS_IP" ]; then
  export ROS_HOSTNAME="${ROS_HOSTNAME:-localhost}"
fi

unset _urban_gnss_root _urban_gnss_shell _urban_gnss_path
