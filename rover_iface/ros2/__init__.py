"""A robot that speaks ROS 2, as a rover: dictionary actions and telemetry keys by ROS names and fields.

`mapping` is the file, `rover.RosRover` the rover behind the ports, `rclpy_port` the only module that knows
rclpy, which users bring with their ROS.
"""
