"""ROS 2 without a ROS installation: topics, transforms and a service over DDS, and the packages for where ROS is."""
