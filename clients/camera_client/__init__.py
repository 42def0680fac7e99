"""Arms of a person before a depth camera, as wrist targets for a robot."""
