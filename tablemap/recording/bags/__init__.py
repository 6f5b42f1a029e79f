"""The bags of ROS 1 and ROS 2: files of rosbag, databases and folders of rosbag2."""
