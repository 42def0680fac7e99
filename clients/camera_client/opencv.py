"""OpenCV, told to keep its warnings to itself: what matters of them is said by who calls it, in one line."""

import cv2

cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)

__all__ = ["cv2"]
