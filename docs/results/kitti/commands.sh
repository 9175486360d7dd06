#!/bin/sh
# The first 51 frames of sequence 06 of the KITTI odometry benchmark, in a folder `odometry` with `sequences/06` and `poses`.
# The name of the dataset, that of its folder, is part of the seeds.
set -e
matchbench import kitti odometry kitti --sequence 06
matchbench run kitti --matchers all --estimator ransac-e,rich,best,adaptive --repeat 5 --out runs/kitti
matchbench eval runs/kitti --format csv > scores.csv
cp runs/kitti/plan.json plan.json # the paths of datasets in it were shortened by hand
