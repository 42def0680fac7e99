"""The browser of the machine that `ik-xr` runs on."""

import os
import sys
import threading
import webbrowser


def open_page(url: str) -> bool:
    """Open a page in the person's browser, where there is a screen to show it; without one no browser is started.

    Args:
        url: The page.

    Returns:
        Whether it was tried.
    """
    windows = sys.platform in ("darwin", "win32") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if not windows:
        return False
    # Some browsers keep who starts them waiting.
    threading.Thread(target=webbrowser.open, args=(url,), name="ik-xr browser", daemon=True).start()
    return True
