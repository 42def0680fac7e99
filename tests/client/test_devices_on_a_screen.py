"""Keys of a real X server (Xvfb): they reach our window, and only while it has the focus."""

import ctypes.util
import shutil
import subprocess
import sys

import pytest

pytest.importorskip("pygame")

PROGRAM = """
import ctypes, time
from ik_client.devices import Devices, open_switch

x, test = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
x.XOpenDisplay.restype = ctypes.c_void_p
display = ctypes.c_void_p(x.XOpenDisplay(None))
space = x.XKeysymToKeycode(display, ctypes.c_ulong(0x20))

def look(devices, wanted):
    end = time.monotonic() + 10.0
    while time.monotonic() < end and switch.held is not wanted:
        devices.pump()
        time.sleep(0.01)
    return switch.held

with Devices((200, 100), "test") as devices:
    switch = open_switch("key:space", devices)
    for _ in range(50):
        devices.pump()
        time.sleep(0.01)
    test.XTestFakeKeyEvent(display, space, 1, ctypes.c_ulong(0))
    x.XFlush(display)
    print(look(devices, True))
    x.XSetInputFocus(display, ctypes.c_ulong(0), 0, ctypes.c_ulong(0))  # nobody has it now
    x.XFlush(display)
    print(look(devices, False), sorted(devices.keys))
"""


def test_a_key_is_held_until_the_window_loses_the_focus():
    if shutil.which("xvfb-run") is None or ctypes.util.find_library("Xtst") is None:
        pytest.skip("no Xvfb, or no libXtst to press keys with: apt install xvfb libxtst6")
    told = subprocess.run(["xvfb-run", "-a", sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=60)
    assert told.stdout.split("\n")[:2] == ["True", "False []"], told.stderr
