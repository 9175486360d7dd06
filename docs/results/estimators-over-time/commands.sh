#!/bin/sh
# castle-P30 of Strecha et al. and freiburg3_long_office_household of TUM RGB-D, as their authors publish them, in folders of
# these names; compare/requirements.txt is installed, and SupeRANSAC, mended as compare/README.md says.
set -e
matchbench import strecha castle-P30 castle
matchbench import tum rgbd_dataset_freiburg3_long_office_household tum --pairs all
matchbench run castle tum --matchers sift --out runs/sift
python compare/over_time.py runs/sift castle sift --truth castle --every 6 --out .
python compare/over_time.py runs/sift tum sift --truth tum --out .
