"""A ROS 2 node: joint states in; what the arm holds, its model's verdict and whatever changed, out as text.

python online_in_ros2.py arm.urdf          # needs ROS 2 (rclpy); says so and ends where there is none
"""

import sys

import numpy as np

import casysid


class Sorted:
    """The robot's joints out of a message that names its own, in any order."""

    def __init__(self, robot: casysid.Robot) -> None:
        """For one robot."""
        self.robot = robot

    def sample(self, message) -> tuple[float, np.ndarray, np.ndarray] | None:
        """Time, positions and torques; None where the message lacks a joint."""
        place = {name: k for k, name in enumerate(message.name)}
        if not all(name in place for name in self.robot.dofs) or len(message.effort) < len(message.name):
            return None
        order = [place[name] for name in self.robot.dofs]
        time = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        return time, np.array(message.position)[order], np.array(message.effort)[order]


def spin(file: str) -> None:
    """Listen until the node is shut down."""
    import rclpy
    from sensor_msgs.msg import JointState
    from std_msgs.msg import String

    robot = casysid.Robot.from_file(file)
    online, joints = casysid.Online(robot), Sorted(robot)
    rclpy.init()
    node = rclpy.create_node("casysid")
    said = node.create_publisher(String, "~/events", 10)

    def heard(message: JointState) -> None:
        sample = joints.sample(message)
        for event in online.add(*sample) if sample else ():
            said.publish(String(data=str(event)))
            node.get_logger().info(str(event))

    node.create_subscription(JointState, "joint_states", heard, 1000)
    node.create_timer(10.0, lambda: node.get_logger().info(online.verdict.headline if online.ready else "learning"))
    rclpy.spin(node)


if __name__ == "__main__":
    try:
        import rclpy  # noqa: F401
    except ImportError:
        print("rclpy is not installed: source a ROS 2 installation first")
    else:
        spin(sys.argv[1])
