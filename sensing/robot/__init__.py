"""From six wrenches to the robot: pose, velocity and shape of a tensegrity robot, and which endcaps hold."""
