"""What importing the thin client costs, seen from a fresh interpreter."""

import subprocess
import sys

HEAVY = ["pinocchio", "casadi", "mujoco", "rich", "zenoh", "hdrh", "ruckig", "ik_service", "sim_client", "uvloop"]
HEAVY += ["scipy", "pygame", "evdev"]


def modules_after(code: str) -> set[str]:
    program = f"{code}\nimport sys; print(*(name.partition('.')[0] for name in sys.modules))"
    return set(
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    )


def test_importing_the_client_loads_nothing_heavy():
    loaded = modules_after("import ik_client")
    assert {"numpy", "msgpack", "orjson", "ik_proto"} <= loaded
    assert not loaded & set(HEAVY)


def test_a_tcp_client_needs_no_zenoh_and_a_zenoh_client_does():
    assert "zenoh" not in modules_after("import ik_client; ik_client.IKClient('tcp://127.0.0.1:1', connect=False)")
    code = """
import ik_client
try:
    ik_client.IKClient('zenoh://127.0.0.1:1', connect_timeout=0.1)
except ik_client.ServiceUnavailable:
    pass
"""
    assert "zenoh" in modules_after(code)


def test_all_names_exist():
    import ik_client

    assert ik_client.__all__ == sorted(ik_client.__all__)
    assert all(hasattr(ik_client, name) for name in ik_client.__all__)
