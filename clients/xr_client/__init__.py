"""The XR client: a WebXR page in a headset in front of the teleop loop.

Nothing is imported here, so that a part can be used without the packages that the others need.
"""
