"""ROS 2 without a ROS installation: messages by rosbags, the wire by Cyclone DDS."""
