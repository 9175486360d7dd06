#!/bin/sh
# 20 frames of the TUM sequence freiburg3_long_office_household: images 0, 30, 60 ... 480 of its rgb.txt and 101, 201,
# 297, with rgb.txt cut to these lines; 19 of them have a pose.
set -e
matchbench import tum rgbd_dataset_freiburg3_long_office_household tum --pairs all
MATCHBENCH_SIMD=avx2 matchbench time tum --matchers all --pairs 12 --csv times.csv
