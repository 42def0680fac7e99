"""Says in one line what to install when an optional part of the distribution is missing."""

from importlib.util import find_spec

_PACKAGES = {
    "sim": ("mujoco", "rich", "imageio", "av", "PIL", "ruckig"),
    "service": ("pinocchio", "casadi", "aiohttp"),
}


def missing_extra(*extras: str) -> str | None:
    """Find out whether some extras are installed.

    Args:
        extras: "sim", "service".

    Returns:
        One line that says what is missing and how to install it; None if nothing is.
    """
    missing = [name for extra in extras for name in _PACKAGES[extra] if find_spec(name) is None]
    if not missing:
        return None
    return f"package {missing[0]} is missing: pip install 'ik-service[{','.join(extras)}]'"
