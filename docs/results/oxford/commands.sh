#!/bin/sh
# boat (zoom and rotation) and leuven (light) of the Oxford affine set, in a folder SEQUENCES; the first image of each
# with the other five.
set -e
matchbench import oxford SEQUENCES oxford
matchbench run oxford --matchers sift,rootsift,surf,orb,brisk,kaze,akaze,asift,gms,repmatch --estimator ransac-h,best-h \
    --repeat 5 --out runs/oxford
matchbench eval runs/oxford --format csv > scores.csv
cp runs/oxford/plan.json plan.json # the paths of datasets in it were shortened by hand
# Beside OpenCV and PoseLib: python compare/homography.py runs/oxford oxford --matchers sift surf orb akaze asift
