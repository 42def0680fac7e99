"""A gamepad drives both wrists of a robot by velocity."""
