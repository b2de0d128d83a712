# To be sourced by bash or zsh, from anywhere: ROS and, once scripts/setup.sh has built it, this package.
#
#   . scripts/environment.sh

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
if [ -z "$ROS_IP" ]; then
  export ROS_HOSTNAME="${ROS_HOSTNAME:-localhost}"
fi

unset _urban_gnss_root _urban_gnss_shell _urban_gnss_path
