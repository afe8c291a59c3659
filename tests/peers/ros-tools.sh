# Sourced, in the root of this repository: installs a receiver for ROS 2 without an installation of it, Cyclone DDS from PyPI under
# target/tools, and provides a network for it; sets ros_tools to its folder.
ros_tools=$(realpath -m "${CARGO_TARGET_DIR:-target}/tools/ros")
tests/venv.sh "$ros_tools" ROS_PEER=0 cyclonedds==11.0.1 mcap==1.6.0 mcap-ros2-support==0.6.0
for needed in unshare ip; do
  command -v $needed >/dev/null || tests/install.sh "leave ROS 2 out with ROS_PEER=0" util-linux iproute2
done
