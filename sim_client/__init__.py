"""A simulated robot as a remote client of the IK service: MuJoCo physics, the teleop loop around it, and pictures.

`ik-sim` and `ik-demo` are its commands. Nothing here imports the service: it is reached over the wire, as from a robot.
"""
