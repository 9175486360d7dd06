#!/bin/sh
# The first 51 frames of sequence 06 of the KITTI odometry benchmark, in a folder `kitti` with `sequences/06` and `poses`.
set -e
matchbench import kitti kitti kitti-06 --sequence 06
matchbench run kitti-06 --matchers all --estimator ransac-e,rich,best,adaptive --repeat 5 --out runs/kitti
matchbench eval runs/kitti --format csv > scores.csv
cp runs/kitti/plan.json plan.json # the paths of datasets in it were shortened by hand
