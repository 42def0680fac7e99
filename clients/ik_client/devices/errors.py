"""What can be wrong with devices."""


class DeviceError(ValueError):
    """A device, or how one was named, cannot be used; one line that says what to do."""
