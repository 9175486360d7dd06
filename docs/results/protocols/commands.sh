#!/bin/sh
# 150 consecutive frames of the scene redkitchen of 7-Scenes: every fifteenth, and all pairs of these ten. Matches of
# ALIKED (n16, mutual nearest neighbours, 640x480) are read from a file that its own program wrote.
set -e
matchbench import 7scenes redkitchen kitchen --pairs window:9,stride:15
matchbench run kitchen --matchers sift --protocol all --out runs/sift
matchbench run kitchen --matches aliked=kitchen.aliked.npz --protocol all --out runs/aliked
matchbench import strecha castle-P30 castle # of Strecha et al., as its authors publish it
matchbench run castle --matchers sift --protocol all --out runs/castle
matchbench eval runs/castle --protocol all --format csv > scores-castle.csv
matchbench eval runs/sift --protocol all --format csv > scores.csv
matchbench eval runs/aliked --protocol all --format csv > scores-aliked.csv
cp runs/sift/plan.json plan.json # the paths of datasets in it were shortened by hand
