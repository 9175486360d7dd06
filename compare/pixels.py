"""How the scripts read images."""

import cv2

# Grey pixels as they are stored, as matchbench reads them, without a turn by EXIF.
GRAY = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
